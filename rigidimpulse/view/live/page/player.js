/* Frames of a run that is still being computed, and the time: play, pause, seek, step. The time goes on as far as frames are there and
   then waits. A time that was kept from an earlier run is waited for; until its frame is there the newest one is shown. */

const POSE = 7; // numbers of a pose: position, quaternion x y z w

class Player {
  /* onTime: when the time has changed; onPicture: before every picture. */
  constructor(animator, onTime, onPicture) {
    Object.assign(this, {animator, onTime, onPicture, wanted: 0, playing: true, loop: true, speed: 1, lastTick: 0});
    this.begin({frames: 1, duration: 0, movers: []});
    animator.update = () => {
      this.tick();
      this.onPicture();
    };
  }

  /* Another run begins; the time stays, and so does whether it plays. */
  begin({frames, duration, movers}) {
    Object.assign(this, {total: frames, end: duration, movers, count: 0, done: false});
    this.poses = new Float32Array(frames * movers.length * POSE);
    this.times = Float64Array.from({length: frames}, (_, k) => (frames > 1 ? (duration * k) / (frames - 1) : 0));
    this.wanted = Math.min(this.wanted, duration);
  }

  add(first, poses) {
    this.poses.set(poses, first * this.movers.length * POSE);
    this.count = first + (this.movers.length > 0 ? poses.length / (this.movers.length * POSE) : this.total);
  }

  get start() { return 0; }

  /* Time of the newest frame. */
  get head() { return this.count > 0 ? this.times[Math.min(this.count, this.total) - 1] : 0; }

  get complete() { return this.count >= this.total; }

  get time() { return Math.min(this.wanted, this.head); }

  /* Index of the frame at or before the time that is shown. */
  get frame() {
    const step = this.total > 1 ? this.end / (this.total - 1) : 1;
    return Math.min(Math.max(Math.floor(this.time / step + 1e-6), 0), Math.max(this.count - 1, 0));
  }

  play() {
    if (this.complete && this.time >= this.end) { this.wanted = 0; }
    this.lastTick = performance.now();
    this.playing = true;
    this.onTime();
  }

  pause() {
    this.wanted = this.time;
    this.playing = false;
    this.onTime();
  }

  seek(time) {
    this.wanted = Math.min(Math.max(time, 0), this.head);
    this.onTime();
  }

  step(frames) {
    this.playing = false;
    this.seek(this.times[Math.min(Math.max(this.frame + frames, 0), Math.max(this.count - 1, 0))]);
  }

  tick() {
    const now = performance.now(), passed = (this.speed * (now - this.lastTick)) / 1000;
    this.lastTick = now;
    if (!this.playing || this.wanted > this.head) { return; } // a time that was kept is waited for
    const next = this.wanted + passed;
    if (next < this.head) {
      this.wanted = next;
    } else if (!this.complete) {
      this.wanted = this.head;
    } else if (this.loop && this.end > 0) {
      this.wanted = next % this.end;
    } else {
      this.wanted = this.end;
      this.playing = false;
    }
    this.onTime();
  }

  /* Puts the nodes (of all bodies) where they are at the time that is shown. */
  pose(nodes) {
    if (this.count === 0) { return; }
    const frame = this.frame, next = Math.min(frame + 1, this.count - 1), span = this.times[next] - this.times[frame];
    const share = span > 0 ? Math.min(Math.max((this.time - this.times[frame]) / span, 0), 1) : 0, row = this.movers.length * POSE;
    this.movers.forEach((body, k) => {
      const a = frame * row + k * POSE, b = next * row + k * POSE, node = nodes[body], at = (i) => this.poses[i];
      node.position.set(at(a) + share * (at(b) - at(a)), at(a + 1) + share * (at(b + 1) - at(a + 1)), at(a + 2) + share * (at(b + 2) - at(a + 2)));
      node.quaternion.fromArray(this.poses, a + 3);
      if (share > 0) { node.quaternion.slerp(new THREE.Quaternion().fromArray(this.poses, b + 3), share); }
    });
  }
}

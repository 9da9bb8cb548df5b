/* Time: play, pause, seek, speed and loop. meshcat's animator keeps the clips; this class tells it the time.
   The animator's own methods are pointed here, so its panel and its frame recorder do the same as our bar. */

class Transport {
  constructor(animator, times, onTime) {
    this.animator = animator;
    this.times = times;
    this.start = times[0];
    this.end = times[times.length - 1];
    this.onTime = onTime;
    this.time = this.start;
    this.playing = false;
    this.loop = true;
    this.lastTick = 0;
    animator.play = () => this.play();
    animator.pause = () => this.pause();
    animator.seek = (time) => this.seek(time);
    animator.reset = () => this.seek(this.start);
    animator.update = () => this.tick();
  }

  get speed() { return this.animator.mixer.timeScale; }

  set speed(value) { this.animator.mixer.timeScale = value; }

  play() {
    if (this.end <= this.start) { return; }
    if (this.time >= this.end) { this.seek(this.start); }
    this.lastTick = performance.now();
    this.playing = true;
    this.onTime();
  }

  pause() {
    this.playing = false;
    if (this.animator.recording) {
      this.animator.stop_capture();
      this.animator.save_capture();
    }
    this.onTime();
  }

  /* Keys are stored as float32: rounding the time alike makes a seek to a recorded time hit its key. */
  seek(time) {
    this.time = Math.min(Math.max(Math.fround(time), this.start), this.end);
    for (const action of this.animator.actions) {
      action.play();
      action.time = this.time;
    }
    this.animator.mixer.update(0);
    this.animator.display_progress(this.time);
    this.animator.viewer.set_dirty();
    this.onTime();
  }

  tick() {
    if (!this.playing) { return; }
    const now = performance.now();
    const next = this.time + (this.speed * (now - this.lastTick)) / 1000;
    this.lastTick = now;
    if (next < this.end) {
      this.seek(next);
    } else if (this.loop && !this.animator.recording) {
      this.seek(this.start + ((next - this.start) % (this.end - this.start)));
    } else {
      this.seek(this.end);
      this.pause();
    }
  }

  /* Index of the frame at or before the present time. */
  get frame() {
    let low = 0, high = this.times.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.times[middle] <= this.time) { low = middle; } else { high = middle - 1; }
    }
    return low;
  }

  step(frames) {
    this.pause();
    const frame = Math.min(Math.max(this.frame + frames, 0), this.times.length - 1);
    this.seek(this.times[frame]);
  }
}

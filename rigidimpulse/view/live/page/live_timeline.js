/* The time line of the live page: that of a recording, whose impacts become more. What is computed of the run is a second line below. */

const HEAD_BELOW = 9; // pixels from the time line

class LiveTimeline extends Timeline {
  constructor(player, arrows, onLayout) {
    super(player, [], (index) => this.goTo(index), onLayout);
    this.arrows = arrows;
  }

  /* Another run. */
  begin() {
    if (this.strip) { this.close(); }
    this.readImpacts();
  }

  readImpacts() {
    this.spikes = this.arrows.spikes(this.transport.end);
    Object.assign(this.line, {spikes: this.spikes, times: this.transport.times});
    this.line.fit(TIMELINE_END, this.line.canvas.clientWidth - TIMELINE_END);
  }

  /* To the impact with a number. */
  goTo(number) {
    this.transport.pause();
    this.transport.seek(this.arrows.timeOf(number));
  }

  draw(time) {
    super.draw(time);
    const {line, transport} = this;
    if (transport.complete) { return; }
    const pen = line.canvas.getContext("2d");
    pen.fillStyle = theme.colour("accent");
    pen.fillRect(line.left, line.base + HEAD_BELOW, line.x(transport.head) - line.left, 2);
  }
}

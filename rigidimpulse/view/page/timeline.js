/* The time line of the bar. Impacts stand on it as spikes, as high as the arrow of the strongest one is long and the stronger in
   colour the more there are. `marks` holds their numbers in equal parts of the run, then the heights, in (0, 1]. */

const TIMELINE_END = 8; // pixels beside its ends
const SPIKE = 18, LEAST_SPIKE = 3; // pixels
const LEAST_STRENGTH = 0.45; // of the colour of a single impact, where others are many

class Timeline extends TimePlot {
  constructor(canvas, times, marks) {
    super(canvas, times);
    this.bins = marks.length / 2;
    this.counts = marks.subarray(0, this.bins);
    this.heights = marks.subarray(this.bins);
  }

  get middle() { return this.height / 2 + 6; }

  fitIfChanged() {
    const {clientWidth, clientHeight} = this.canvas;
    if (clientWidth !== this.width || clientHeight !== this.height || window.devicePixelRatio !== this.scale) {
      this.fit(TIMELINE_END, clientWidth - TIMELINE_END);
    }
  }

  drawLayer(pen) {
    const columns = Math.max(Math.round(this.right - this.left), 1) + 1;
    const counts = new Float32Array(columns), heights = new Float32Array(columns);
    this.counts.forEach((count, bin) => {
      if (count > 0) {
        const column = Math.min(Math.round(((bin + 0.5) / this.bins) * (columns - 1)), columns - 1);
        counts[column] += count;
        heights[column] = Math.max(heights[column], this.heights[bin]);
      }
    });
    const most = Math.log1p(counts.reduce((a, b) => Math.max(a, b), 1));
    counts.forEach((count, column) => {
      if (count > 0) {
        const strength = LEAST_STRENGTH + (1 - LEAST_STRENGTH) * (Math.log1p(count) / most);
        const tall = LEAST_SPIKE + (SPIKE - LEAST_SPIKE) * heights[column];
        pen.fillStyle = `rgba(255, 74, 28, ${strength})`;
        pen.fillRect(this.left + column - 0.75, this.middle - 2 - tall, 1.5, tall);
      }
    });
  }

  draw(time) {
    this.fitIfChanged();
    const pen = this.pen(this.canvas), now = this.x(time), middle = this.middle;
    this.copyLayer(pen, now, 0.45);
    pen.lineCap = "round";
    for (const [colour, from, to] of [["rgba(29, 39, 48, 0.18)", this.left, this.right], [PLOT_INK, this.left, now]]) {
      pen.strokeStyle = colour;
      pen.lineWidth = 3;
      pen.beginPath();
      pen.moveTo(from, middle);
      pen.lineTo(to, middle);
      pen.stroke();
    }
    pen.fillStyle = PLOT_INK;
    pen.beginPath();
    pen.arc(now, middle, 6, 0, 2 * Math.PI);
    pen.fill();
  }
}

/* Impacts along a strip of time, gathered so that each mark can be read: single spikes, and hills of many close ones. */

const LEAST_GAP = 14; // pixels between spikes that stand alone
const LEAST_HILL = 6; // spikes; fewer close ones are drawn side by side

/* Gathers spikes ({x, ...}, by x) into hills; returns groups, each of one spike or of a hill. */
function gather(spikes, gap = LEAST_GAP, least = LEAST_HILL) {
  const groups = [];
  let run = [];
  const close = () => {
    if (run.length >= least) { groups.push(run); } else { groups.push(...run.map((spike) => [spike])); }
    run = [];
  };
  for (const spike of spikes) {
    if (run.length > 0 && spike.x - run[run.length - 1].x >= gap) { close(); }
    run.push(spike);
  }
  if (run.length > 0) { close(); }
  return groups;
}

/* Impacts of one instant are one spike: as high as the strongest of them, which is the one that a click selects. */
function makeSpikes(times, heights) {
  const spikes = [];
  times.forEach((time, index) => {
    const last = spikes[spikes.length - 1];
    if (last && last.time === time) {
      last.count += 1;
      last.members.push(index);
      if (heights[index] > last.height) { Object.assign(last, {height: heights[index], index}); }
    } else {
      spikes.push({time, height: heights[index], index, count: 1, members: [index]});
    }
  });
  return spikes;
}

/* Spikes of a run with too many impacts for a card each: one for each part of the run. `marks` holds numbers, then heights. */
function binnedSpikes(marks, start, end, strongestIn) {
  const bins = marks.length / 2, spikes = [];
  for (let bin = 0; bin < bins; bin++) {
    if (marks[bin] > 0) {
      const from = start + ((end - start) * bin) / bins, to = start + ((end - start) * (bin + 1)) / bins, index = strongestIn(from, to);
      spikes.push({time: (from + to) / 2, height: marks[bins + bin], index, count: marks[bin], members: index < 0 ? [] : [index]});
    }
  }
  return spikes;
}

// Plots as SVG.

const PLOT = { width: 300, height: 178, left: 48, right: 10, top: 8, bottom: 32 };

/** Return about so many round numbers between two. */
function ticks(least, greatest, count = 5) {
  const rough = (greatest - least) / count || 1;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((it) => it >= rough * 0.999);
  const list = [];
  for (let value = Math.ceil(least / step - 1e-9) * step; value <= greatest + step * 1e-6; value += step) list.push(value);
  return list;
}

/** Return an empty plot with axes, and the functions from values to places. */
function axes(x, y, title, options = {}) {
  const { width, height, left, right, top, bottom } = { ...PLOT, ...options };
  const across = (value) => left + (value - x.least) / (x.greatest - x.least || 1) * (width - left - right);
  const up = (value) => height - bottom - (value - y.least) / (y.greatest - y.least || 1) * (height - top - bottom);
  const svg = draw('svg', { class: 'plot', width, height, viewBox: `0 0 ${width} ${height}`, role: 'img', 'aria-label': title });
  for (const value of x.ticks || ticks(x.least, x.greatest)) {
    svg.append(draw('line', { class: 'axis', x1: across(value), x2: across(value), y1: top, y2: height - bottom }));
    svg.append(draw('text', { x: across(value), y: height - bottom + 13, 'text-anchor': 'middle' }, tickText(value)));
  }
  for (const value of y.ticks || ticks(y.least, y.greatest, 4)) {
    svg.append(draw('line', { class: 'axis', x1: left, x2: width - right, y1: up(value), y2: up(value) }));
    svg.append(draw('text', { x: left - 5, y: up(value) + 4, 'text-anchor': 'end' }, tickText(value)));
  }
  svg.append(draw('text', { x: (left + width - right) / 2, y: height - 4, 'text-anchor': 'middle' }, x.label));
  svg.append(draw('text', { transform: `translate(10 ${(top + height - bottom) / 2}) rotate(-90)`, 'text-anchor': 'middle' }, y.label));
  return { svg, across, up };
}

function tickText(value) {
  return Math.abs(value) >= 1e4 ? `${value / 1000} k` : String(Number(value.toPrecision(6)));
}

function figure(title, svg) {
  return make('figure', {}, make('figcaption', { textContent: title }), svg);
}

function range(values, margin = 0.06) {
  const [least, greatest] = [Math.min(...values), Math.max(...values)];
  const more = (greatest - least || Math.abs(least) || 1) * margin;
  return { least: least - more, greatest: greatest + more };
}

/** A dot for every filter tried, a line for the best so far. */
function fitnessPlot(search) {
  const fitness = search.discrepancies.map((it) => 1 / (it + 1));
  const count = fitness.length;
  const plot = axes(
    { least: 0, greatest: count + 1, label: 'filters tried' },
    { least: 0, greatest: 1.04, ticks: [0, 0.25, 0.5, 0.75, 1], label: '1 / (|N − n| + 1)' },
    `Fitness of ${count} filters, the best ${decimals(Math.max(...fitness), 3)}`,
  );
  const { svg, across, up } = plot;
  for (const end of search.generations.slice(0, -1)) {
    svg.append(draw('line', { class: 'generation', x1: across(end + 0.5), x2: across(end + 0.5), y1: up(0), y2: up(1) }));
  }
  let best = 0;
  let path = '';
  fitness.forEach((value, index) => {
    best = Math.max(best, value);
    path += `${index ? 'L' : 'M'}${across(index + 1)} ${up(best)}`;
    const dot = draw('circle', { class: 'dot', cx: across(index + 1), cy: up(value), r: 2.5 });
    dot.append(draw('title', {}, filterTitle(search, index)));
    svg.append(dot);
  });
  svg.append(draw('path', { class: 'best', d: path }));
  return figure('Fitness over evaluations', svg);
}

function filterTitle(search, index) {
  return `filter ${index + 1}: γH ${shortNumber(search.gamma_high[index])}, γL ${shortNumber(search.gamma_low[index])}, `
    + `D0 ${shortNumber(search.cutoff[index])}, c ${shortNumber(search.attenuation[index])}; |N − n| = ${search.discrepancies[index]}`;
}

/** A dot for every filter at its gains, the larger the better; a ring around what was chosen. */
function gainsPlot(search, filter) {
  const most = Math.max(...search.discrepancies, 1);
  const { svg, across, up } = axes(
    { ...range(search.gamma_low), label: 'gain of low frequencies γL' },
    { ...range(search.gamma_high), label: 'gain of high frequencies γH' },
    'Gains of the filters tried',
  );
  const order = search.discrepancies.map((_, index) => index).sort((a, b) => search.discrepancies[b] - search.discrepancies[a]);
  for (const index of order) {
    const good = 1 - search.discrepancies[index] / most;
    const dot = draw('circle', {
      class: 'dot', cx: across(search.gamma_low[index]), cy: up(search.gamma_high[index]), r: 2 + 5 * good,
      style: `fill: color-mix(in oklab, var(--found) ${Math.round(100 * good)}%, var(--bar))`,
    });
    dot.append(draw('title', {}, filterTitle(search, index)));
    svg.append(dot);
  }
  if (filter.applied) {
    svg.append(draw('circle', { class: 'ring', cx: across(filter.gamma_low), cy: up(filter.gamma_high), r: 9 }));
  }
  return figure('Gains tried: large and green where more targets were shown; the ring is the filter used', svg);
}

/** Bars for the numbers of values in bins of equal width; of integers, in bins that hold as many. */
function histogram(title, label, values, options = {}) {
  if (!values.length) return null;
  let { bins = 24 } = options;
  let { least, greatest } = range(values, 0.02);
  let width = (greatest - least) / bins;
  if (options.integers) {
    const most = Math.max(...values);
    width = Math.ceil((most + 1) / bins);
    bins = Math.ceil((most + 1) / width);
    [least, greatest] = [-0.5, bins * width - 0.5];
  }
  const counts = new Array(bins).fill(0);
  for (const value of values) counts[Math.min(bins - 1, Math.max(0, Math.floor((value - least) / width)))]++;
  const { svg, across, up } = axes(
    { least, greatest, label }, { least: 0, greatest: Math.max(...counts) * 1.05, label: options.noun || 'targets' },
    `${title}: ${plural(values.length, 'value')} from ${shortNumber(Math.min(...values))} to ${shortNumber(Math.max(...values))}`,
  );
  counts.forEach((count, index) => {
    if (!count) return;
    const left = across(least + index * width);
    const bar = draw('rect', { class: 'bar', x: left + 0.5, width: Math.max(1, across(least + (index + 1) * width) - left - 1), y: up(count), height: up(0) - up(count) });
    bar.append(draw('title', {}, `${shortNumber(least + index * width)} to ${shortNumber(least + (index + 1) * width)}: ${count}`));
    svg.append(bar);
  });
  return figure(title, svg);
}

/** Bars for numbers of values between bounds. */
function classes(title, label, values, bounds) {
  const counts = bounds.slice(1).map((upper, index) => values.filter(
    (it) => it >= bounds[index] && (it < upper || (index === bounds.length - 2 && it <= upper))).length);
  const { svg, across, up } = axes(
    { least: 0, greatest: counts.length, ticks: [], label }, { least: 0, greatest: Math.max(...counts, 1) * 1.1, label: 'targets' }, title);
  counts.forEach((count, index) => {
    const left = across(index);
    const width = across(index + 1) - left;
    svg.append(draw('rect', { class: 'bar', x: left + 2, width: width - 4, y: up(count), height: up(0) - up(count) }));
    svg.append(draw('text', { x: left + width / 2, y: up(count) - 3, 'text-anchor': 'middle' }, count || ''));
    svg.append(draw('text', { x: left, y: up(0) + 13, 'text-anchor': 'middle' }, bounds[index]));
  });
  svg.append(draw('text', { x: across(counts.length), y: up(0) + 13, 'text-anchor': 'end' }, bounds[counts.length]));
  return figure(title, svg);
}

/** A dot for every error, circles for scale. */
function errorPlot(title, errors) {
  if (!errors.length) return null;
  const far = Math.max(...errors.flat().map(Math.abs)) * 1.1 || 1;
  const side = { width: 210, height: 210 };
  const { svg, across, up } = axes(
    { least: -far, greatest: far, label: 'x, px', ticks: ticks(-far, far, 3) },
    { least: -far, greatest: far, label: 'y, px', ticks: ticks(-far, far, 3) }, title, side);
  for (const [x, y] of errors) svg.append(draw('circle', { class: 'dot', cx: across(x), cy: up(-y), r: 2 }));
  const rmse = Math.sqrt(errors.reduce((sum, [x, y]) => sum + x * x + y * y, 0) / errors.length);
  return figure(`${title}, RMSE ${decimals(rmse, 4)} px`, svg);
}

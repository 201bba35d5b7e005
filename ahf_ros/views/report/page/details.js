// What the panels below the viewer say about an image.

const panels = [
  { name: 'targets', label: (record) => `Targets ${record.targets.length}`, build: targetsPanel },
  { name: 'undecided', label: (record) => `Not identified ${undecidedCount(record)}`, build: undecidedPanel },
  { name: 'search', label: () => 'Search', build: searchPanel },
  { name: 'plots', label: () => 'Sizes and errors', build: plotsPanel },
];

let panelShown = 'targets';

function undecidedCount(record) {
  return record.missed + record.undecoded.filter((row) => row[6] !== 'unread').length || '';
}

/** Show what is known about an image. */
function showDetails(record) {
  byId('image-name').textContent = record.name;
  byId('image-name').title = record.image;
  byId('image-summary').textContent = summaryOf(record);
  buildTabs(byId('panels'), panels.map((panel) => ({ name: panel.name, label: panel.label(record) })), panelShown, (name) => {
    panelShown = name;
    showDetails(record);
  });
  const panel = panels.find((item) => item.name === panelShown);
  byId('panel').setAttribute('aria-labelledby', `tab-${panelShown}`);
  byId('panel').replaceChildren(...panel.build(record).filter((item) => item !== null));
  byId('panel').scrollTop = 0;
}

function summaryOf(record) {
  const parts = [`${record.identified}${record.expected ? ` of ${record.estimated ? 'an estimated ' : ''}${record.expected}` : ''} identified`];
  if (record.missed && record.expected) parts.push(`${record.missed} missed`);
  if (record.doubtful) parts.push([`${record.doubtful} doubtful`, ...record.doubts].join(': '));
  if (record.wrong) parts.push(`${record.wrong} wrong`);
  if (record.mirrored) parts.push('the image seems to be mirrored');
  if (record.edges) parts.push(record.edges);
  parts.push(...record.advice);
  if (record.images.length > 1) parts.push(`stack of ${record.images.length}, ${record.combination || 'first image'}`);
  parts.push(record.filter.applied ? `filter γH ${shortNumber(record.filter.gamma_high)}, γL ${shortNumber(record.filter.gamma_low)}` : 'no filter');
  return [...parts, `${record.detector} ${record.family}`].join(' · ');
}

/** Build a row of tabs. */
function buildTabs(host, items, chosen, choose) {
  const focused = host.contains(document.activeElement);
  host.replaceChildren(...items.map(({ name, label }) => make('button', {
    type: 'button', id: `tab-${name}`, textContent: label, tabIndex: name === chosen ? 0 : -1,
    _role: 'tab', '_aria-selected': name === chosen, onclick: () => choose(name),
    onkeydown: (event) => {
      const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!step) return;
      event.stopPropagation();
      const names = items.map((item) => item.name);
      choose(names[(names.indexOf(name) + step + names.length) % names.length]);
    },
  })));
  if (focused) byId(`tab-${chosen}`).focus();
}

/** Return a table whose rows show their marks when they are chosen. */
function markTable(heads, rows) {
  const head = make('tr', {}, ...heads.map(([label, text, title]) => make('th', {
    _scope: 'col', textContent: label, className: text ? 'text' : '', title: title || '' })));
  const body = rows.map(({ cells, mark }) => {
    const row = make('tr', { tabIndex: mark ? 0 : -1 }, ...cells.map((cell, index) => make('td', {
      textContent: cell, className: heads[index][1] ? 'text' : '' })));
    if (mark) {
      row.onclick = () => choose(mark, true);
      row.onkeydown = (event) => { if (event.key === 'Enter') choose(mark, true); };
    }
    return row;
  });
  return make('table', { className: 'plain' }, make('thead', {}, head), make('tbody', {}, ...body));
}

const words = { found: '', doubtful: 'doubtful', wrong: 'wrong' };

function targetsPanel(record) {
  const marks = viewer.marks.filter((mark) => mark.id >= 0 && mark.kind !== 'missed');
  if (!marks.length) return [note('No target was identified.')];
  const several = about.families.length > 1;
  const heads = [['ID'], ['x px'], ['y px'], ['confidence'], ['semi-axes px'], ['σx px', false, 'standard deviation'], ['σy px', false, 'standard deviation'],
    ...(several ? [['family', true]] : []), ['', true]];
  return [markTable(heads, marks.map((mark) => ({
    mark,
    cells: [mark.id, decimals(mark.x, 3), decimals(mark.y, 3), confidenceText(mark.confidence),
      `${decimals(mark.major, 2)} × ${decimals(mark.minor, 2)}`, sigma(mark.sigmaX), sigma(mark.sigmaY),
      ...(several ? [about.families[mark.family] || ''] : []), words[mark.kind]],
  })))];
}

function sigma(value) {
  return value ? decimals(value, 4) : '–';
}

function undecidedPanel(record) {
  const parts = [];
  if (record.missedIds.length) parts.push(note(`Expected and missed: ${listed(record.missedIds)}.`));
  else if (record.missed && record.expected) {
    parts.push(note(`${plural(record.missed, 'target')} of ${record.expected} missed. Which ones is known if results were found with --expected-ids, or with --truth of this report.`));
  }
  if (record.unexpectedIds.length) parts.push(note(`Identified and not expected: ${listed(record.unexpectedIds)}.`));
  const marks = viewer.marks.filter((mark) => mark.reason || mark.kind === 'missed');
  const likely = marks.filter((mark) => mark.reason !== 'unread');
  if (likely.length) {
    parts.push(markTable([['perhaps'], ['x px'], ['y px'], ['confidence'], ['radius px'], ['why', true]], likely.map((mark) => ({
      mark,
      cells: [mark.kind === 'missed' ? mark.id : mark.likely >= 0 ? mark.likely : '', decimals(mark.x, 1), decimals(mark.y, 1),
        mark.kind === 'missed' ? '' : confidenceText(mark.confidence), mark.kind === 'missed' ? '' : decimals(mark.major, 1),
        whyOf(mark)],
    }))));
  }
  if (record.unread) {
    const dots = marks.length - likely.length;
    parts.push(note(`${plural(record.unread, 'dot')} without a likely code word, dotted in the image${dots < record.unread ? ` (the ${dots} largest)` : ''}.`));
  }
  if (!withUndecoded) parts.push(note('Dots that were found but not read are in the results with --report-undecoded.'));
  if (!parts.length) parts.push(note('Nothing is missed or doubtful.'));
  return parts;
}

/** Why a target is not identified; of a missed one, what was found at its place. */
function whyOf(mark) {
  if (mark.kind !== 'missed') return reasons[mark.reason] || '';
  const near = viewer.marks.find((other) => other.kind !== 'missed' && Math.hypot(other.x - mark.x, other.y - mark.y) < Math.max(5, mark.major));
  if (!near) return 'missed: no dot was found at its place';
  return near.reason ? `missed: ${reasons[near.reason]}` : `missed: identified as ${near.id}`;
}

function searchPanel(record) {
  const { search, filter } = record;
  if (!search) {
    const why = !record.expected ? 'N was not given, so that there was nothing to search for.'
      : record.missed ? 'The results hold no search: it was switched off, or they are from another program.'
        : 'The image as received, or the filter of the image before, showed all N targets.';
    return [note(`No filter was searched for. ${why}`)];
  }
  const tried = search.discrepancies.length;
  const ends = { found: 'a filter showed N targets', patience: 'several in a row showed no more', evaluations: 'the limit of filters was reached',
    generations: 'the limit of generations was reached', stall: 'many generations brought nothing', duration: 'the time was over', exhausted: 'all filters were tried' };
  const used = filter.applied
    ? `Used: γH ${shortNumber(filter.gamma_high)}, γL ${shortNumber(filter.gamma_low)}, D0 ${shortNumber(filter.cutoff)} cycles per image, c ${shortNumber(filter.attenuation)}.`
    : 'No filter showed more targets than the image as received.';
  return [
    note(`${plural(tried, 'filter')} tried; the search ended because ${ends[search.reason] || search.reason}. ${used}`),
    make('div', { className: 'plots' }, fitnessPlot(search), gainsPlot(search, filter)),
  ];
}

function plotsPanel(record) {
  const found = viewer.marks.filter((mark) => mark.id >= 0 && mark.kind !== 'missed');
  if (!found.length) return [note('No target was identified.')];
  const deviations = found.filter((mark) => mark.sigmaX).map((mark) => Math.hypot(mark.sigmaX, mark.sigmaY) / Math.SQRT2);
  const plots = [
    histogram('Size of the dots', 'mean radius, px', found.map(radiusOf), { bins: 16 }),
    classes('Confidence', 'confidence', found.map((mark) => mark.confidence), CONFIDENCES),
    histogram('Standard deviation of the centres', 'σ, px', deviations, { bins: 16 }),
    record.truth ? errorPlot('Measured minus true', record.truth.errors.map(([, x, y]) => [x, y])) : null,
  ];
  return [make('div', { className: 'plots' }, ...plots)];
}

const CONFIDENCES = [0, 0.7, 0.9, 0.95, 0.99, 0.999, 1];

function radiusOf(mark) {
  return Math.sqrt(mark.major * mark.minor);
}

function note(text) {
  return make('p', { className: 'note', textContent: text });
}

/** Return IDs as a list with ranges. */
function listed(ids) {
  const parts = [];
  for (let start = 0; start < ids.length;) {
    let end = start;
    while (ids[end + 1] === ids[end] + 1) end++;
    parts.push(end > start + 1 ? `${ids[start]}–${ids[end]}` : ids.slice(start, end + 1).join(', '));
    start = end + 1;
  }
  return parts.join(', ');
}

// What all images together say: how often each ID was identified, and distributions.

/** Return for each ID in how many images it was found, missed and doubtful. */
function countIds() {
  const counts = new Map();
  const of = (id) => counts.get(id) || counts.set(id, { id, found: 0, missed: 0, doubtful: 0, confidence: 1 }).get(id);
  for (const record of records) {
    for (const id of record.found) of(id).found++;
    for (const id of record.lost) of(id).missed++;
    for (const id of record.likely) of(id).doubtful++;
    for (const row of record.targets) of(row[0]).confidence = Math.min(of(row[0]).confidence, row[6]);
  }
  return [...counts.values()].sort((a, b) => a.id - b.id);
}

function totals() {
  const sum = (key) => records.reduce((total, record) => total + record[key], 0);
  return { identified: sum('identified'), expected: sum('expected'), missed: sum('missed'), doubtful: sum('doubtful'), wrong: sum('wrong'), seconds: sum('seconds') };
}

/** Write the line at the top. */
function showTotals() {
  const all = totals();
  const number = (value) => value.toLocaleString('en');
  const part = (value, noun, className) => [make('b', { className: value ? className : '', textContent: number(value) }), ` ${noun}   `];
  byId('totals').replaceChildren(
    ...part(records.length, records.length === 1 ? 'image' : 'images', ''),
    ...part(all.identified, all.expected ? `of ${number(all.expected)} found` : 'found', 'found'),
    ...(all.expected ? part(all.missed, 'missed', 'missed') : []),
    ...part(all.doubtful, 'doubtful', 'doubt'),
    ...(withTruth ? part(all.wrong, 'wrong', 'missed') : []),
    ...(problems.size ? part(problems.size, 'without picture', 'missed') : []),
  );
}

/** Build the side that is about all images, when it is first shown. */
function showOverview() {
  const host = byId('all-side');
  if (host.childElementCount) return;
  const rows = records.flatMap((record) => record.targets);
  const radii = rows.map((row) => Math.sqrt(row[3] * row[4]));
  const deviations = rows.filter((row) => row[7]).map((row) => Math.hypot(row[7], row[8]) / Math.SQRT2);
  const errors = records.flatMap((record) => (record.truth ? record.truth.errors.map(([, x, y]) => [x, y]) : []));
  const ids = countIds();
  const plots = [
    histogram('Images that show an ID', 'images', ids.map((it) => it.found), { integers: true, noun: 'IDs' }),
    plotRange('Size of the dots', 'mean radius, px', radii),
    classes('Confidence', 'confidence', rows.map((row) => row[6]), CONFIDENCES),
    plotRange('Standard deviation of the centres', 'σ, px', deviations),
    errors.length ? errorPlot('Measured minus true', thinned(errors)) : null,
  ];
  host.append(
    make('div', { className: 'plots' }, ...plots),
    make('h3', { textContent: `${plural(ids.length, 'ID')}` }),
    note('A row shows the images that concern its ID.'),
    idTable(ids),
  );
}

/** A histogram without the outermost values, which would leave no room for the others. */
function plotRange(title, label, values) {
  const ordered = thinned(values).sort((a, b) => a - b);
  const cut = Math.floor(ordered.length / 500);
  return histogram(title, label, ordered.slice(cut, ordered.length - cut));
}

/** At most so many values, evenly chosen: functions take no more arguments. */
function thinned(values, most = 20000) {
  const step = Math.max(1, values.length / most);
  return step === 1 ? values.slice() : Array.from({ length: most }, (_, index) => values[Math.floor(index * step)]);
}

function idTable(ids) {
  const heads = [['ID'], ['found in'], ['missed in'], ['doubtful in'], ['lowest confidence']];
  const built = markTable(heads, ids.map((it) => ({ cells: [it.id, it.found, it.missed || '', it.doubtful || '', it.found ? confidenceText(it.confidence) : ''] })));
  [...built.tBodies[0].rows].forEach((row, index) => {
    row.tabIndex = 0;
    const show = () => {
      byId('id-filter').value = ids[index].id;
      updateTable();
    };
    row.onclick = show;
    row.onkeydown = (event) => { if (event.key === 'Enter') show(); };
  });
  return built;
}

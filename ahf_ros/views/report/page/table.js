// The table of images: only the rows in sight exist.

const ROW_HEIGHT = 47;
const MARGIN_ROWS = 8;

const columns = [
  { key: 'thumbnail', label: '', width: '76px' },
  { key: 'name', label: 'Image', value: (record) => record.image, text: true },
  { key: 'identified', label: 'Found', width: '76px', value: (record) => record.identified },
  { key: 'missed', label: 'Missed', width: '58px',
    value: (record) => (record.expected ? record.missed : -1) },
  { key: 'doubtful', label: 'Doubtful', width: '68px', value: (record) => record.doubtful },
  ...(withTruth ? [{ key: 'wrong', label: 'Wrong', width: '54px', value: (record) => record.wrong }] : []),
  { key: 'filter', label: 'Filter γ', width: '96px',
    value: (record) => (record.filter.applied ? record.filter.gamma_high : -1) },
  { key: 'tries', label: 'Tries', width: '44px', value: (record) => record.filter.evaluations },
  { key: 'seconds', label: 'Time s', width: '54px', value: (record) => record.seconds },
];

const table = {
  scroll: byId('rows'),
  body: document.querySelector('#rows tbody'),
  shown: records.slice(),
  selected: null,
  order: { key: null, direction: 1 },
  first: -1,
  last: -1,
  onselect: () => {},
};

function buildHead() {
  const head = byId('head');
  for (const column of columns) {
    const cell = make('th', { _scope: 'col', className: column.text ? '' : `number is-${column.key}` });
    if (column.width) cell.style.width = column.width;
    if (column.value) {
      cell.append(make('button', {
        type: 'button', textContent: column.label, onclick: () => sortBy(column.key),
      }));
      cell.dataset.key = column.key;
    } else cell.append(make('span', { className: 'hidden', textContent: 'Picture' }));
    head.append(cell);
  }
}

/** Sort by a column; again, the other way round; a third time, in the order of the results. */
function sortBy(key) {
  const before = table.order;
  const falling = key !== 'name';
  if (before.key !== key) table.order = { key, direction: falling ? -1 : 1 };
  else if (before.direction === (falling ? -1 : 1)) table.order = { key, direction: falling ? 1 : -1 };
  else table.order = { key: null, direction: 1 };
  for (const cell of byId('head').querySelectorAll('[data-key]')) {
    const direction = cell.dataset.key === table.order.key ? table.order.direction : 0;
    cell.setAttribute('aria-sort', ['descending', 'none', 'ascending'][direction + 1]);
    cell.firstElementChild.dataset.order = direction;
  }
  updateTable();
}

const collator = new Intl.Collator('en', { numeric: true });

function sorted(list) {
  const column = columns.find((item) => item.key === table.order.key);
  if (!column) return list;
  const { direction } = table.order;
  return list.sort((a, b) => {
    const [one, other] = [column.value(a), column.value(b)];
    const difference = column.text ? collator.compare(one, other) : one - other;
    return direction * difference || a.index - b.index;
  });
}

/** Filter, sort and show the images. */
function updateTable() {
  performance.mark('ahf-filter');
  const words = byId('name-filter').value.toLowerCase().split(/\s+/).filter(Boolean);
  const ids = idsIn(byId('id-filter').value);
  const chosen = document.querySelector('#status-filter input:checked');
  const status = statuses.find((item) => item.name === (chosen ? chosen.value : 'all'));
  const list = records.filter((record) => words.every((word) => record.search_text.includes(word))
    && status.holds(record)
    && (!ids || [...ids].some((id) => status.ids(record, id))));
  table.shown = sorted(list);
  byId('count').textContent = `${list.length.toLocaleString('en')} of ${plural(records.length, 'image')}`;
  table.scroll.scrollTop = 0;
  showRows(true);
  performance.measure('ahf-filtered', 'ahf-filter');
}

/** Show the rows in sight. */
function showRows(always = false) {
  const { scroll, shown } = table;
  const height = scroll.clientHeight || 600;
  const first = Math.max(0, Math.floor(scroll.scrollTop / ROW_HEIGHT) - MARGIN_ROWS);
  const last = Math.min(shown.length, Math.ceil((scroll.scrollTop + height) / ROW_HEIGHT) + MARGIN_ROWS);
  if (!always && first === table.first && last === table.last) return;
  [table.first, table.last] = [first, last];
  const rows = shown.slice(first, last).map((record, offset) => rowOf(record, first + offset));
  table.body.replaceChildren(gap(first), ...rows, gap(shown.length - last));
  table.scroll.firstElementChild.setAttribute('aria-rowcount', shown.length + 1);
}

function gap(count) {
  const cell = make('td');
  cell.style.height = `${count * ROW_HEIGHT}px`;
  return make('tr', { className: 'gap', _role: 'presentation' }, cell);
}

function rowOf(record, position) {
  const row = make('tr', { '_aria-rowindex': position + 2, onclick: () => select(record) });
  row.dataset.index = record.index;
  row.setAttribute('aria-selected', record === table.selected);
  row.append(...columns.map((column) => cellOf(record, column.key)));
  return row;
}

function cellOf(record, key) {
  if (key === 'thumbnail') return make('td', {}, thumbnailOf(record));
  if (key === 'name') {
    const cell = make('td', { title: record.image }, make('span', { className: 'file', textContent: record.name }));
    if (record.folder) cell.append(make('span', { className: 'path' }, make('bdi', { textContent: record.folder })));
    return cell;
  }
  if (key === 'identified') return foundCell(record);
  const texts = {
    missed: () => (record.expected ? record.missed || '' : '–'),
    doubtful: () => record.doubtful || '',
    wrong: () => record.wrong || '',
    filter: () => filterText(record.filter),
    tries: () => record.filter.evaluations || '',
    seconds: () => decimals(record.seconds, record.seconds < 10 ? 2 : 1),
  };
  const colours = { missed: 'missed', doubtful: 'doubt', wrong: 'missed' };
  return make('td', { className: `number is-${key} ${colours[key] || ''}`, textContent: texts[key]() });
}

function filterText(filter) {
  return filter.applied ? [filter.gamma_high, filter.gamma_low].map((it) => decimals(it, 2)).join(' / ') : '';
}

function shortNumber(value) {
  return String(Number(value.toPrecision(3)));
}

function foundCell(record) {
  const of = record.expected ? ` / ${record.estimated ? '≈' : ''}${record.expected}` : '';
  const share = record.expected ? Math.min(1, record.identified / record.expected) : 1;
  const bar = make('i');
  bar.style.width = `${100 * share}%`;
  const meter = make('span', { className: 'meter', '_aria-hidden': 'true' }, bar);
  return make('td', { className: 'number' }, make('b', { textContent: record.identified }), of, meter);
}

function thumbnailOf(record) {
  const element = pictureElement('thumbnail', record.index);
  if (!element) return make('span', { className: 'thumb', title: problems.get(record.index) || '' });
  return make('img', { className: 'thumb', alt: '', decoding: 'async', src: pictureAddress(element) });
}

/** Choose an image. */
function select(record) {
  table.selected = record;
  for (const row of table.body.children) {
    if (row.dataset.index) row.setAttribute('aria-selected', Number(row.dataset.index) === record.index);
  }
  table.onselect(record);
}

/** Choose the image that is so many rows further. */
function selectNext(step) {
  const { shown, scroll } = table;
  if (!shown.length) return;
  const now = shown.indexOf(table.selected);
  const next = now < 0 ? 0 : Math.max(0, Math.min(shown.length - 1, now + step));
  const top = next * ROW_HEIGHT;
  const room = scroll.clientHeight - byId('head').offsetHeight - ROW_HEIGHT;
  if (top < scroll.scrollTop) scroll.scrollTop = top;
  else if (top > scroll.scrollTop + room) scroll.scrollTop = top - room;
  select(shown[next]);
  showRows(true);
}

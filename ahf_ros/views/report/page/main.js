// How the parts of the page work together.

const sides = [{ name: 'image-side', label: 'Image' }, { name: 'all-side', label: 'All images' }];

function showSide(name) {
  buildTabs(byId('sides'), sides, name, showSide);
  for (const side of sides) byId(side.name).hidden = side.name !== name;
  if (name === 'all-side') showOverview();
  else applyView();
}

/** Build a group of radio buttons or check boxes. */
function buildChoices(host, type, items, onchange) {
  for (const { name, label, checked, title } of items) {
    const input = make('input', { type, name: host.id, value: name, checked, onchange });
    host.append(make('label', { className: 'choice', title: title || '' }, input, make('span', { textContent: label })));
  }
}

function setMode(mode) {
  if (!viewer.record || !pictureElement('filtered', viewer.record.index)) return;
  viewer.mode = mode;
  layOut();
  applyView();
}

function toggleLayer(name) {
  const input = document.querySelector(`#layers input[value="${name}"]`);
  input.checked = !input.checked;
  applyView();
}

function showImage(record) {
  showSide('image-side');
  view(record);
  showDetails(record);
}

const STEP = 0.1; // of the width that is shown, by which a key moves the image

const keys = {
  j: () => selectNext(1), k: () => selectNext(-1),
  '/': () => byId('name-filter').focus(), i: () => byId('id-filter').focus(),
  '+': () => zoomBy(1.4), '=': () => zoomBy(1.4), '-': () => zoomBy(1 / 1.4), 0: fitView,
  f: () => setMode(viewer.mode === 'filtered' ? 'original' : 'filtered'),
  s: () => setMode(viewer.mode === 'both' ? 'original' : 'both'),
  o: () => toggleLayer('outline'), l: () => toggleLayer('label'), c: () => toggleLayer('confidence'), d: () => toggleLayer('unread'),
  a: () => showSide(byId('all-side').hidden ? 'all-side' : 'image-side'),
  '?': () => byId('help').showModal(),
};

const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

function onKey(event) {
  if (event.ctrlKey || event.altKey || event.metaKey || byId('help').open) return;
  const typing = event.target.matches('input[type="search"]');
  if (typing) {
    if (event.key === 'Escape') event.target.blur();
    return;
  }
  const arrow = arrows[event.key];
  if (arrow && event.shiftKey) moveBy(arrow[0] * STEP * viewer.view.width, arrow[1] * STEP * viewer.view.height);
  else if (arrow && arrow[1] && !event.target.matches('input, #panel')) selectNext(arrow[1]);
  else if (keys[event.key] && !event.target.closest('dialog')) keys[event.key]();
  else return;
  event.preventDefault();
}

/** Go from what the system prefers to the other, and back. */
function switchTheme() {
  const root = document.documentElement;
  const dark = root.dataset.theme ? root.dataset.theme === 'dark' : matchMedia('(prefers-color-scheme: dark)').matches;
  root.dataset.theme = dark ? 'light' : 'dark';
}

function wire() {
  buildHead();
  buildChoices(byId('status-filter'), 'radio', statuses.map((it) => ({ ...it, checked: it.name === 'all' })), updateTable);
  statusBox('problem').hidden = true;
  buildChoices(byId('mode'), 'radio', [
    { name: 'original', label: 'Original', checked: true }, { name: 'filtered', label: 'Filtered', title: 'f' },
    { name: 'both', label: 'Side by side', title: 's' }], (event) => setMode(event.target.value));
  buildChoices(byId('layers'), 'checkbox', [
    { name: 'outline', label: 'Outlines', checked: true, title: 'o' }, { name: 'label', label: 'IDs', checked: true, title: 'l' },
    { name: 'confidence', label: 'Confidence', checked: true, title: 'c' }, { name: 'unread', label: 'Unread dots', checked: true, title: 'd' }], applyView);
  byId('filters').onsubmit = (event) => event.preventDefault();
  for (const name of ['name-filter', 'id-filter']) byId(name).oninput = updateTable;
  let waiting = false;
  table.scroll.onscroll = () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      showRows();
    });
  };
  new ResizeObserver(() => showRows()).observe(table.scroll);
  table.onselect = showImage;
  const buttons = { previous: () => selectNext(-1), next: () => selectNext(1), 'zoom-in': keys['+'], 'zoom-out': keys['-'], fit: fitView,
    theme: switchTheme, 'help-button': keys['?'] };
  for (const [id, action] of Object.entries(buttons)) byId(id).onclick = action;
  byId('light').oninput = (event) => viewer.host.style.setProperty('--light', 2 ** event.target.value);
  document.addEventListener('keydown', onKey);
}

function statusBox(name) {
  return document.querySelector(`#status-filter input[value="${name}"]`).parentElement;
}

/** Show what became known behind this script: pictures, and images that have none. */
function finish() {
  for (const [index, text] of Object.entries(JSON.parse(byId('problems').textContent))) problems.set(Number(index), text);
  statusBox('problem').hidden = !problems.size;
  showTotals();
  showRows(true);
  if (viewer.record && !viewer.panes.every((pane) => pane.pictured)) view(viewer.record);
  performance.mark('ahf-complete');
}

wire();
showTotals();
updateTable();
if (records.length) select(records[0]);
performance.mark('ahf-table');
document.addEventListener('DOMContentLoaded', finish);

// The viewer: one or two panes that show the same part of an image, with its marks on it.

const PIXELATED = 4; // px of the screen per px of the picture, from which pixels are shown as such
const MOST_MAGNIFIED = 64; // px of the screen per px of the image
const CROWDED = 100; // px of the screen between targets, below which confidences are hidden

const viewer = {
  host: byId('viewer'),
  record: null,
  marks: [],
  panes: [],
  view: { x: 0, y: 0, width: 1, height: 1 },
  mode: 'original',
  spacing: 0,
};

const captions = { original: 'original', filtered: 'filtered' };

/** Show an image. */
function view(record) {
  viewer.record = record;
  viewer.marks = marksOf(record);
  viewer.spacing = spacingOf(viewer.marks);
  layOut();
  fitView();
}

/** Build the panes of the chosen mode. */
function layOut() {
  const { record, host } = viewer;
  for (const mark of viewer.marks) mark.groups = [];
  const filtered = pictureElement('filtered', record.index) !== null;
  const names = !filtered ? ['original'] : viewer.mode === 'both' ? ['original', 'filtered'] : [viewer.mode];
  viewer.panes = names.map((name) => paneOf(record, name));
  host.replaceChildren(...viewer.panes.map((pane) => pane.box));
  for (const input of document.querySelectorAll('#mode input')) {
    input.disabled = !filtered && input.value !== 'original';
    input.checked = input.value === (filtered ? viewer.mode : 'original');
  }
  notePicture();
}

function paneOf(record, name) {
  const element = pictureElement(name, record.index);
  const { width, height } = sizeOf(record);
  const svg = draw('svg', {
    tabindex: 0, role: 'img', preserveAspectRatio: 'xMidYMid meet',
    'aria-label': `${record.name}, ${captions[name]}, ${plural(record.identified, 'target')} identified`,
  });
  const box = make('div', { className: 'pane' }, svg);
  if (element) {
    svg.append(draw('image', {
      href: pictureAddress(element), x: -0.5, y: -0.5, width, height, preserveAspectRatio: 'none',
    }));
    if (record.filter.applied) box.append(make('span', { className: 'caption', textContent: captionOf(record, name) }));
  } else {
    const text = problems.get(record.index)
      || (document.readyState === 'loading' ? 'The pictures are being read …' : 'There is no picture.');
    box.append(make('div', { className: 'lost', textContent: text }));
  }
  const marks = draw('g', { class: 'marks' }, ...viewer.marks.map((mark) => drawMark(mark, width, height)));
  svg.append(marks);
  listen(svg);
  return { box, svg, marks, pictured: Boolean(element), scale: element ? element.dataset.width / width : 1 };
}

function captionOf(record, name) {
  if (name === 'original') return record.combination ? `${record.combination} of the stack` : 'original';
  const { gamma_high: high, gamma_low: low } = record.filter;
  return `filtered, γH ${shortNumber(high)}, γL ${shortNumber(low)}`;
}

/** The size of an image; of results that do not say it, that of what they show. */
function sizeOf(record) {
  if (record.width) return record;
  const far = (index) => Math.max(1, ...record.targets.map((row) => row[index])) * 1.1;
  return { width: far(1), height: far(2) };
}

function notePicture() {
  const { record } = viewer;
  const element = pictureElement('original', record.index);
  const { width, height } = sizeOf(record);
  const size = `Image ${Math.round(width)} × ${Math.round(height)} px`;
  if (!element) byId('picture-note').textContent = `${size}.`;
  else {
    const kilobytes = Math.round(element.textContent.length * 0.75 / 1000);
    const reduced = Number(element.dataset.width) < width;
    byId('picture-note').textContent = `${size}; picture ${element.dataset.width} × ${element.dataset.height} px, ${kilobytes} kB${
      reduced ? `, reduced so that a page of ${plural(records.length, 'image')} stays below ${about.maxSize} MB (--max-size)` : ''}.`;
  }
}

/** Return the drawing of a mark; lengths that do not belong to the target follow the zoom. */
function drawMark(mark, width, height) {
  const group = draw('g', { class: `mark is-${mark.kind}` });
  mark.groups.push(group);
  group.append(draw('title', {}, describe(mark)));
  if (mark.kind === 'missed') {
    const cross = draw('g', { transform: `translate(${mark.x} ${mark.y})` });
    for (const name of ['halo', 'line']) cross.append(draw('path', { class: `${name} cross`, d: 'M-8-8L8 8M8-8L-8 8' }));
    group.append(cross);
  } else {
    drawOutlines(group, mark);
    const arm = 0.35 * mark.minor;
    if (mark.kind !== 'unread') {
      group.append(draw('path', { class: 'line', d: `M${mark.x - arm} ${mark.y}h${2 * arm}m${-arm} ${-arm}v${2 * arm}` }));
    }
  }
  group.append(...drawTexts(mark, width, height));
  group.addEventListener('click', () => choose(mark));
  return group;
}

/** Draw the square of a marker, or the dots of a target and the circle that holds it. */
function drawOutlines(group, mark) {
  if (mark.corners) {
    for (const name of ['halo', 'line']) group.append(draw('polygon', { class: name, points: mark.corners.join(' ') }));
    return;
  }
  const template = mark.dots ? mark.dots.ellipses : [[mark.x, mark.y, mark.major, mark.minor, mark.angle]];
  template.forEach((ellipse, index) => {
    const code = mark.dots && index >= mark.dots.template ? ' code' : '';
    group.append(drawEllipse(ellipse, 'halo'), drawEllipse(ellipse, `line${code}`));
  });
  const reach = about.reach[mark.family] || 1;
  if (reach > 1 && !mark.dots) {
    group.append(drawEllipse([mark.x, mark.y, reach * mark.major, reach * mark.minor, mark.angle], 'reach'));
  }
}

function drawEllipse([x, y, major, minor, angle], name) {
  return draw('ellipse', { class: name, cx: x, cy: y, rx: major, ry: minor, transform: `rotate(${angle} ${x} ${y})` });
}

/** Return ID and confidence, beside the target so that they hide nothing of it. */
function drawTexts(mark, width, height) {
  if (mark.kind === 'unread') return [];
  const distance = 0.74 * (mark.dots ? 1.6 : about.reach[mark.family] || 1.4) * mark.major;
  const left = mark.x + distance > 0.92 * width;
  const below = mark.y - distance < 0.04 * height;
  const place = {
    x: mark.x + (left ? -distance : distance), y: mark.y + (below ? distance : -distance),
    'text-anchor': left ? 'end' : 'start', dx: left ? '-0.25em' : '0.25em',
  };
  const texts = [draw('text', { ...place, class: 'id', dy: below ? '0.8em' : '0' }, labelOf(mark))];
  if (mark.confidence !== undefined && mark.kind !== 'missed') {
    texts.push(draw('text', { ...place, class: 'confidence', dy: below ? '2em' : '1.15em' }, confidenceText(mark.confidence)));
  }
  return texts;
}

function labelOf(mark) {
  if (mark.id < 0) return mark.likely >= 0 ? `${mark.likely}?` : '?';
  return mark.kind === 'doubtful' ? `${mark.id}?` : String(mark.id);
}

const reasons = {
  unread: 'found as a dot, no code word is likely',
  uncertain: 'read, but not certain',
  contested: 'read, but another target contradicts it',
};

function describe(mark) {
  const place = `(${decimals(mark.x, 1)}, ${decimals(mark.y, 1)})`;
  if (mark.kind === 'missed') return `${mark.id}: missed, true place ${place}`;
  const name = mark.id >= 0 ? `${mark.id}${mark.kind === 'wrong' ? ', wrong' : ''}`
    : `${mark.likely >= 0 ? `perhaps ${mark.likely}: ` : ''}${reasons[mark.reason]}`;
  return `${name}\n${place} px, semi-axes ${decimals(mark.major, 2)} × ${decimals(mark.minor, 2)} px\nconfidence ${confidenceText(mark.confidence)}`;
}

/** Half of the targets have another one within this distance, px of the image. */
function spacingOf(marks) {
  const some = marks.filter((mark) => mark.kind !== 'unread').slice(0, 400);
  const nearest = some.map((mark) => Math.min(...some.filter((other) => other !== mark)
    .map((other) => Math.hypot(other.x - mark.x, other.y - mark.y)))).sort((a, b) => a - b);
  return nearest.length ? nearest[nearest.length >> 1] : Infinity;
}

/** Show the whole image. */
function fitView() {
  const { width, height } = sizeOf(viewer.record);
  viewer.view = { x: -0.5, y: -0.5, width, height };
  applyView();
}

/** Return the px of the image per px of the screen. */
function unitOf() {
  const { svg } = viewer.panes[0];
  const { width, height } = viewer.view;
  return Math.max(width / Math.max(svg.clientWidth, 1), height / Math.max(svg.clientHeight, 1));
}

function applyView() {
  if (!viewer.record) return;
  const { x, y, width, height } = viewer.view;
  const unit = unitOf();
  for (const { svg, scale } of viewer.panes) {
    svg.setAttribute('viewBox', `${x} ${y} ${width} ${height}`);
    svg.style.setProperty('--unit', unit);
    svg.classList.toggle('crowded', viewer.spacing / unit < CROWDED);
    svg.classList.toggle('magnified', 1 / (unit * scale) > PIXELATED);
    for (const input of document.querySelectorAll('#layers input')) svg.classList.toggle(`no-${input.value}`, !input.checked);
  }
  byId('zoom').textContent = `${Math.round(100 / unit)} %`;
}

/** Zoom by a factor about a point of the image, its middle by default. */
function zoomBy(factor, point = null) {
  const { view: now } = viewer;
  const { width } = sizeOf(viewer.record);
  const least = width * 4;
  const unit = unitOf();
  const limited = Math.max(factor, now.width / least, 0);
  const used = Math.min(limited, MOST_MAGNIFIED * unit);
  const centre = point || { x: now.x + now.width / 2, y: now.y + now.height / 2 };
  viewer.view = {
    x: centre.x - (centre.x - now.x) / used, y: centre.y - (centre.y - now.y) / used,
    width: now.width / used, height: now.height / used,
  };
  applyView();
}

function moveBy(x, y) {
  viewer.view = { ...viewer.view, x: viewer.view.x + x, y: viewer.view.y + y };
  applyView();
}

/** Show a target large, and mark it. */
function choose(mark, zooming = false) {
  for (const other of viewer.marks) for (const group of other.groups) group.classList.toggle('chosen', other === mark);
  if (!zooming) return;
  const { svg } = viewer.panes[0];
  const reach = (about.reach[mark.family] || 3) * mark.major;
  const width = Math.max(8 * reach, 60);
  const height = width * svg.clientHeight / Math.max(svg.clientWidth, 1);
  viewer.view = { x: mark.x - width / 2, y: mark.y - height / 2, width, height };
  applyView();
}

/** Drag, wheel and double-click. */
function listen(svg) {
  const pointAt = (event) => new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
  svg.addEventListener('wheel', (event) => {
    event.preventDefault();
    zoomBy(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.002)), pointAt(event));
  }, { passive: false });
  svg.addEventListener('dblclick', (event) => zoomBy(2, pointAt(event)));
  svg.addEventListener('pointermove', (event) => {
    if (event.buttons !== 1) return;
    if (!svg.hasPointerCapture(event.pointerId)) svg.setPointerCapture(event.pointerId);
    const unit = unitOf();
    moveBy(-event.movementX * unit, -event.movementY * unit);
  });
}

new ResizeObserver(() => applyView()).observe(viewer.host);

'use strict';
// What the page knows: the records of all images, what each of them shows, and helpers for all.

performance.mark('ahf-start');

const about = JSON.parse(document.getElementById('about').textContent);
const records = JSON.parse(document.getElementById('records').textContent);
const problems = new Map();

const byId = (id) => document.getElementById(id);

/** Return an HTML element with properties, attributes (after `_`) and children. */
function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name.startsWith('_')) element.setAttribute(name.slice(1), value);
    else element[name] = value;
  }
  element.append(...children.filter((child) => child !== null));
  return element;
}

/** Return an SVG element with attributes and children. */
function draw(tag, attributes = {}, ...children) {
  const element = document.createElementNS('http://www.w3.org/2000/svg', tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

function fileName(path) {
  return path.slice(Math.max(path.lastIndexOf('/'), path.lastIndexOf('\\')) + 1);
}

function folderName(path) {
  return path.slice(0, path.length - fileName(path).length).replace(/[/\\]$/, '');
}

function decimals(value, count) {
  return value.toFixed(count);
}

/** Return a confidence so that 1 is only what is exactly 1. */
function confidenceText(value) {
  if (value > 0.9999 && value < 1) return '> 0.9999';
  return value >= 0.999 && value < 1 ? decimals(value, 4) : decimals(value, 3);
}

function plural(count, noun) {
  return `${count.toLocaleString('en')} ${noun}${count === 1 ? '' : 's'}`;
}

/** The target of a row of numbers. */
function targetOf([id, x, y, major, minor, angle, confidence, sigmaX, sigmaY, family], index) {
  return { id, x, y, major, minor, angle, confidence, sigmaX, sigmaY, family, index };
}

/** The undecoded target of a row. */
function undecodedOf([x, y, major, minor, angle, confidence, reason, likely]) {
  return { id: -1, x, y, major, minor, angle, confidence, reason, likely };
}

/** Return all that an image shows, each with the `kind` that decides how it looks. */
function marksOf(record) {
  const wrong = new Set(record.truth ? record.truth.wrong : []);
  const dots = new Map(record.dots.map((item) => [item.id, item]));
  const squares = new Map(record.squares.map((item) => [item.id, item.corners]));
  const marks = record.targets.map((row, index) => {
    const target = targetOf(row, index);
    target.kind = wrong.has(index) ? 'wrong'
      : target.confidence < about.doubtfulBelow ? 'doubtful' : 'found';
    target.dots = dots.get(target.id);
    target.corners = squares.get(target.id);
    return target;
  });
  for (const row of record.undecoded) {
    const target = undecodedOf(row);
    target.kind = target.reason === 'unread' ? 'unread' : 'doubtful';
    marks.push(target);
  }
  const size = typicalSize(marks);
  for (const [id, x, y] of record.truth ? record.truth.missed : []) {
    marks.push({ id, x, y, major: size, minor: size, angle: 0, kind: 'missed' });
  }
  return marks;
}

function typicalSize(marks) {
  const sizes = marks.filter((mark) => mark.kind === 'found').map((mark) => mark.major);
  return sizes.length ? sizes.sort((a, b) => a - b)[sizes.length >> 1] : 10;
}

/** Return a picture's element in the page, null where there is none. */
function pictureElement(name, index) {
  return byId(`${name}-${index}`);
}

/** Return the address of a picture. */
function pictureAddress(element) {
  return `data:${element.dataset.kind};base64,${element.textContent}`;
}

/** Derived columns of a record: what the table shows, sorts and filters. */
records.forEach((record, index) => {
  record.index = index;
  record.name = fileName(record.image);
  record.folder = folderName(record.image);
  record.search_text = record.image.toLowerCase();
  record.wrong = record.truth ? record.truth.wrong.length : 0;
  record.lowest = record.targets.reduce((least, row) => Math.min(least, row[6]), Infinity);
  record.found = new Set(record.targets.map((row) => row[0]));
  record.likely = new Set(record.undecoded.map((row) => row[7]).filter((id) => id >= 0));
  for (const row of record.targets) if (row[6] < about.doubtfulBelow) record.likely.add(row[0]);
  record.lost = new Set(record.missedIds);
});

const withTruth = records.some((record) => record.truth);
const withUndecoded = records.some((record) => record.undecoded.length);

/** The statuses that images are filtered by. */
const statuses = [
  { name: 'all', label: 'All', holds: () => true,
    ids: (record, id) => record.found.has(id) || record.likely.has(id) || record.lost.has(id) },
  { name: 'missed', label: 'Missed', holds: (record) => record.missed > 0,
    ids: (record, id) => record.lost.has(id) },
  { name: 'doubtful', label: 'Doubtful', holds: (record) => record.doubtful > 0,
    ids: (record, id) => record.likely.has(id) },
  ...(withTruth ? [{ name: 'wrong', label: 'Wrong', holds: (record) => record.wrong > 0,
    ids: (record, id) => record.found.has(id) }] : []),
  { name: 'problem', label: 'No picture', holds: (record) => problems.has(record.index),
    ids: (record, id) => record.found.has(id) },
];

/** Return the IDs that a text such as `7, 10-12` lists; null where it lists none. */
function idsIn(text) {
  const ids = new Set();
  for (const part of text.split(/[\s,;]+/).filter(Boolean)) {
    const [, first, last] = part.match(/^(\d{1,9})(?:-(\d{1,9}))?$/) || [];
    if (first === undefined) continue;
    const end = Math.min(Number(last ?? first), Number(first) + 100000);
    for (let id = Number(first); id <= end; id++) ids.add(id);
  }
  return ids.size ? ids : null;
}

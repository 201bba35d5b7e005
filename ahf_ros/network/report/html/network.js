// The network in space: parallel lines stay parallel, so that scale bars hold anywhere.
'use strict';
(() => {
  const canvas = document.getElementById('turning');
  const box = document.getElementById('with-photographs');
  const scene = JSON.parse(document.getElementById('scene').textContent);
  const draw = canvas.getContext('2d');
  const begin = { yaw: -0.5, pitch: 1.0, zoom: 1 };
  const NAMED = 150, APART = [16, 9], NEAR = 12, MARGIN = 30; // targets; px
  let view = { ...begin }, drawn = [], near = -1;

  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const times = ([xx, xy, xz, yy, yz, zz], v) => [
    xx * v[0] + xy * v[1] + xz * v[2], xy * v[0] + yy * v[1] + yz * v[2],
    xz * v[0] + yz * v[1] + zz * v[2]];
  const round = (limit) => { // 1, 2 or 5 times a power of ten, up to a limit
    const power = 10 ** Math.floor(Math.log10(limit));
    return [5, 2, 1].find((step) => step * power <= limit * 1.000001) * power;
  };

  function directions() { // right, up and towards the viewer
    const [s, c] = [Math.sin(view.yaw), Math.cos(view.yaw)];
    const [sp, cp] = [Math.sin(view.pitch), Math.cos(view.pitch)];
    return [[c, -s, 0], [s * cp, c * cp, sp], [-s * sp, -c * sp, cp]];
  }

  function paint() {
    const ratio = Math.max(window.devicePixelRatio || 1, 2); // sharp where it is printed
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!width) return;
    [canvas.width, canvas.height] = [width * ratio, height * ratio];
    draw.setTransform(ratio, 0, 0, ratio, 0, 0);
    draw.font = '11px system-ui, "DejaVu Sans", sans-serif';
    const style = getComputedStyle(document.documentElement);
    const colour = (name) => style.getPropertyValue(`--${name}`).trim();
    const [right, up, towards] = directions();
    const cameras = box.checked ? scene.cameras : [];
    const all = [...scene.places, ...cameras];
    // A sphere about all, so that nothing leaves the picture or changes its size as it turns.
    const middle = [0, 1, 2].map((axis) => {
      const values = all.map((it) => it[axis]);
      return values.length ? (Math.min(...values) + Math.max(...values)) / 2 : 0;
    });
    const from = (it) => [it[0] - middle[0], it[1] - middle[1], it[2] - middle[2]];
    const radius = Math.max(...all.map((it) => Math.hypot(...from(it))), 1e-12);
    const scale = view.zoom * (Math.min(width, height) / 2 - MARGIN) / radius;
    const placed = (it) => {
      const at = from(it);
      return [width / 2 + scale * dot(at, right), height / 2 - scale * dot(at, up)];
    };
    const line = (ends, kind, dashed) => {
      draw.strokeStyle = colour(kind);
      draw.setLineDash(dashed ? [5, 3] : []);
      draw.beginPath();
      ends.forEach((it, index) => draw[index ? 'lineTo' : 'moveTo'](...it));
      draw.stroke();
      draw.setLineDash([]);
    };

    draw.lineWidth = 1.2;
    for (const it of cameras) pyramid(it, radius / view.zoom, placed, line);
    for (const [first, second, check] of scene.bars)
      line([placed(scene.places[first]), placed(scene.places[second])], 'found', check);
    for (const [index, check] of scene.control) {
      const [x, y] = placed(scene.places[index]);
      line([[x - 6, y - 6], [x + 6, y - 6], [x + 6, y + 6], [x - 6, y + 6], [x - 6, y - 6]], 'found', check);
    }
    draw.lineWidth = 1;
    drawn = scene.places.map(placed);
    const order = drawn.map((_, index) => index);
    order.sort((a, b) => dot(scene.places[a], towards) - dot(scene.places[b], towards));
    for (const index of order) ellipse(index, right, up, scale, colour);
    names(order, colour);
    scales(height, scale, colour, line);
    triad(width, height, right, up, colour);
  }

  function pyramid(camera, radius, placed, line) { // with its base where it looks
    const [place, forward, right] = [camera.slice(0, 3), camera.slice(3, 6), camera.slice(6)];
    const down = [0, 1, 2].map((i) =>
      forward[(i + 1) % 3] * right[(i + 2) % 3] - forward[(i + 2) % 3] * right[(i + 1) % 3]);
    const size = 0.06 * radius;
    const corner = ([x, y]) => placed(
      place.map((it, axis) => it + size * (forward[axis] + x * right[axis] + y * down[axis])));
    const base = [[-0.5, -0.4], [0.5, -0.4], [0.5, 0.4], [-0.5, 0.4]].map(corner);
    line([...base, base[0]], 'doubt');
    for (const it of base) line([placed(place), it], 'doubt');
  }

  function ellipse(index, right, up, scale, colour) {
    const spread = scene.spreads[index], [x, y] = drawn[index];
    const [a, b, c] = [dot(right, times(spread, right)), dot(right, times(spread, up)),
      dot(up, times(spread, up))];
    const [mean, apart] = [(a + c) / 2, Math.hypot((a - c) / 2, b)];
    const angle = -Math.atan2(2 * b, a - c) / 2; // y goes down on the screen
    draw.beginPath();
    draw.ellipse(x, y, scale * Math.sqrt(Math.max(mean + apart, 0)),
      scale * Math.sqrt(Math.max(mean - apart, 0)), angle, 0, 2 * Math.PI);
    draw.fillStyle = draw.strokeStyle = colour('accent');
    draw.globalAlpha = 0.18;
    draw.fill();
    draw.globalAlpha = 1;
    draw.stroke();
    draw.beginPath();
    draw.arc(x, y, index === near ? 3 : 1.4, 0, 2 * Math.PI);
    draw.fillStyle = colour('ink');
    draw.fill();
  }

  function names(order, colour) { // the nearest ones first, where they can be read
    const written = [];
    draw.fillStyle = colour('ink');
    for (const index of [...(near < 0 ? [] : [near]), ...[...order].reverse()]) {
      const [x, y] = drawn[index];
      if (index !== near && order.length > NAMED) continue;
      if (written.some(([u, v]) => Math.abs(x - u) < APART[0] && Math.abs(y - v) < APART[1])) continue;
      written.push([x, y]);
      draw.fillText(scene.targets[index], x + 5, y - 5);
    }
  }

  function scales(height, scale, colour, line) {
    const bars = [['', scale, 12], ['ellipses: ', scale * scene.enlarged, 28]];
    draw.fillStyle = colour('ink');
    for (const [of, pixels, above] of bars) {
      const length = round(120 / pixels), [end, y] = [12 + length * pixels, height - above];
      line([[12, y - 4], [12, y + 4], [12, y], [end, y], [end, y - 4], [end, y + 4]], 'ink');
      draw.fillText(`${of}${Number(length.toPrecision(1))} ${scene.unit}`, end + 6, y + 4);
    }
  }

  function triad(width, height, right, up, colour) { // where the axes point
    draw.fillStyle = colour('dim');
    scene.axes.forEach((name, axis) => {
      const [x, y] = [width - 80 + 32 * right[axis], height - 50 - 32 * up[axis]];
      draw.strokeStyle = colour('dim');
      draw.beginPath();
      draw.moveTo(width - 80, height - 50);
      draw.lineTo(x, y);
      draw.stroke();
      draw.fillText(name, x + 2, y - 2);
    });
  }

  function turn(across, down) {
    view.yaw -= across;
    view.pitch = Math.min(Math.max(view.pitch - down, -Math.PI / 2), Math.PI / 2);
    paint();
  }

  function enlarge(factor) {
    view.zoom = Math.min(Math.max(view.zoom * factor, 0.5), 50);
    paint();
  }

  const keys = {
    ArrowLeft: () => turn(0.1, 0), ArrowRight: () => turn(-0.1, 0),
    ArrowUp: () => turn(0, 0.1), ArrowDown: () => turn(0, -0.1),
    '+': () => enlarge(1.25), '-': () => enlarge(0.8),
  };
  canvas.addEventListener('keydown', (event) => {
    if (!keys[event.key]) return;
    keys[event.key]();
    event.preventDefault();
  });
  canvas.addEventListener('wheel', (event) => {
    if (document.activeElement !== canvas) return; // or nobody could scroll past it
    enlarge(1.0015 ** -event.deltaY);
    event.preventDefault();
  }, { passive: false });
  canvas.addEventListener('pointerdown', (event) => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener('pointermove', (event) => {
    if (event.buttons) {
      turn(-0.008 * event.movementX, -0.008 * event.movementY);
      return;
    }
    const found = drawn.findIndex(([x, y]) => Math.hypot(x - event.offsetX, y - event.offsetY) < NEAR);
    if (found === near) return;
    near = found;
    paint();
  });
  canvas.addEventListener('dblclick', () => { view = { ...begin }; paint(); });
  box.addEventListener('change', paint);
  window.addEventListener('resize', paint);
  window.matchMedia('(prefers-color-scheme: dark)').addEventListener('change', paint);
  window.addEventListener('beforeprint', () => { // dark ink on paper
    document.documentElement.dataset.theme = 'light';
    paint();
  });
  window.addEventListener('afterprint', () => {
    delete document.documentElement.dataset.theme;
    paint();
  });
  canvas.hidden = false;
  paint();
})();

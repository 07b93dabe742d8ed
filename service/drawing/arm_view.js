// Draws an arm into a canvas, with a depth buffer. Dragging or the arrow keys turn it; once it has the focus, the
// wheel or + and - zoom: the wheel of somebody who only scrolls the page must not. Lengths in mm.
function drawArm(canvas, geometry, view) {
  const cross = (a, b) => [a[1]*b[2]-a[2]*b[1], a[2]*b[0]-a[0]*b[2], a[0]*b[1]-a[1]*b[0]];
  const dot = (a, b) => a[0]*b[0] + a[1]*b[1] + a[2]*b[2];
  const unit = a => { const l = Math.hypot(...a) || 1; return a.map(x => x / l); };
  const up = view.up, helper = Math.abs(up[0]) < 0.6 ? [1, 0, 0] : [0, 1, 0];
  const side = unit(cross(up, helper)), front = cross(side, up);
  const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer;
  const rgb = text => { const c = parseInt(text.slice(1), 16); return [c >> 16, c >> 8 & 255, c & 255]; };
  // A mesh in the base frame, and the normal of each vertex: the mean of its triangles', by their size.
  function placed(mesh, pose, color) {
    const own = new Int16Array(bytes(mesh.vertices)), faces = new Uint16Array(bytes(mesh.faces));
    const points = new Float32Array(own.length), normals = new Float32Array(own.length);
    for (let i = 0; i < own.length; i += 3)
      for (let r = 0; r < 3; r++)
        points[i+r] = pose[r] + 0.1 * (pose[3+3*r]*own[i] + pose[4+3*r]*own[i+1] + pose[5+3*r]*own[i+2]);
    for (let i = 0; i < faces.length; i += 3) {
      const [a, b, c] = [3*faces[i], 3*faces[i+1], 3*faces[i+2]];
      const n = cross([0, 1, 2].map(k => points[b+k] - points[a+k]), [0, 1, 2].map(k => points[c+k] - points[a+k]));
      for (const v of [a, b, c]) for (let k = 0; k < 3; k++) normals[v+k] += n[k];
    }
    for (let i = 0; i < normals.length; i += 3) {
      const l = Math.hypot(normals[i], normals[i+1], normals[i+2]) || 1;
      for (let k = 0; k < 3; k++) normals[i+k] /= l;
    }
    return {points, normals, faces, color: rgb(color)};
  }
  const links = geometry.map((link, k) => placed(link, view.poses[k], link.color));
  const region = view.region ? placed(view.region, view.poses[view.region.link], view.color) : null;
  const low = [1e9, 1e9, 1e9], high = [-1e9, -1e9, -1e9];
  for (const {points} of links)
    for (let i = 0; i < points.length; i++) {
      low[i % 3] = Math.min(low[i % 3], points[i]); high[i % 3] = Math.max(high[i % 3], points[i]);
    }
  const center = low.map((x, i) => (x + high[i]) / 2);
  let azimuth = 0.9, elevation = 0.35, zoom = 1;
  function camera() {
    const ca = Math.cos(azimuth), sa = Math.sin(azimuth), ce = Math.cos(elevation), se = Math.sin(elevation);
    const toward = [0, 1, 2].map(i => ce * (ca * front[i] + sa * side[i]) + se * up[i]);
    const right = unit(cross(up, toward));
    return [right, cross(toward, right), toward];
  }
  // Whether a part of the arm is between the viewer and the contact. The contact is raised by 3 mm: meshes are made
  // of chords.
  function isHidden() {
    const [right, top, toward] = camera(), eye = view.point.map((x, i) => x + 3 * view.normal[i]);
    return links.some(({points, faces}) => {
      const seen = new Float32Array(points.length);
      for (let i = 0; i < points.length; i += 3) {
        const d = [points[i] - eye[0], points[i+1] - eye[1], points[i+2] - eye[2]];
        seen[i] = dot(d, right); seen[i+1] = dot(d, top); seen[i+2] = dot(d, toward);
      }
      for (let i = 0; i < faces.length; i += 3) {
        const [a, b, c] = [3*faces[i], 3*faces[i+1], 3*faces[i+2]];
        const u = seen[b] * seen[c+1] - seen[c] * seen[b+1], v = seen[c] * seen[a+1] - seen[a] * seen[c+1];
        const w = seen[a] * seen[b+1] - seen[b] * seen[a+1], size = u + v + w;
        const within = (u >= 0 && v >= 0 && w >= 0) || (u <= 0 && v <= 0 && w <= 0);
        if (size && within && (u * seen[a+2] + v * seen[b+2] + w * seen[c+2]) / size > 0) return true;
      }
      return false;
    });
  }
  // Looks at the contact from the side that it is on, a little from above, past what is in front of it.
  if (view.normal) {
    const around = Math.atan2(dot(view.normal, side), dot(view.normal, front));
    const above = Math.max(-0.4, Math.min(0.9, 0.6 * Math.asin(Math.max(-1, Math.min(1, dot(view.normal, up)))) + 0.25));
    const views = [0, 0.4, -0.4, 0.8, -0.8].flatMap(
      higher => [0.5, -0.5, 0, 1, -1].map(aside => [around + aside, above + higher]));
    const shown = views.find(turned => { [azimuth, elevation] = turned; return !isHidden(); });
    [azimuth, elevation] = shown || views[0];
  }
  // The whole arm fits into the picture as it is seen at first.
  const [right0, top0] = camera();
  let wide = 1, tall = 1;
  for (const points of [...links.map(link => link.points), view.arrow || []])
    for (let i = 0; i < points.length; i += 3) {
      const d = [0, 1, 2].map(k => points[i + k] - center[k]);
      wide = Math.max(wide, Math.abs(dot(d, right0))); tall = Math.max(tall, Math.abs(dot(d, top0)));
    }
  const context = canvas.getContext("2d"), buffer = document.createElement("canvas");
  function draw() {
    const ratio = window.devicePixelRatio || 1, w = canvas.clientWidth, h = canvas.clientHeight;
    if (!w || !h) return;
    // Twice as many pixels as are shown, for smooth edges.
    const fine = Math.max(2, ratio), W = Math.ceil(w * fine), H = Math.ceil(h * fine);
    const [right, top, toward] = camera(), scale = 0.46 * zoom * Math.min(w / wide, h / tall);
    const project = p => {
      const d = [p[0]-center[0], p[1]-center[1], p[2]-center[2]];
      return [w / 2 + scale * dot(d, right), h / 2 - scale * dot(d, top), dot(d, toward)];
    };
    const light = unit([0, 1, 2].map(i => toward[i] + 0.6 * top[i] - 0.4 * right[i]));
    buffer.width = W; buffer.height = H;
    const ink = buffer.getContext("2d"), image = ink.createImageData(W, H), pixels = image.data;
    const depth = new Float32Array(W * H).fill(-1e9), covered = new Uint8Array(region ? W * H : 0);
    function paint(mesh, cover) {
      const {points, normals, faces, color} = mesh, count = points.length / 3, seen = new Float32Array(4 * count);
      for (let i = 0; i < count; i++) {
        const p = project([points[3*i], points[3*i+1], points[3*i+2]]);
        seen[4*i] = p[0] * fine; seen[4*i+1] = p[1] * fine; seen[4*i+2] = p[2];
        const s = normals[3*i]*light[0] + normals[3*i+1]*light[1] + normals[3*i+2]*light[2];
        seen[4*i+3] = 0.4 + 0.6 * Math.max(0, s);
      }
      for (let i = 0; i < faces.length; i += 3) {
        const a = 4*faces[i], b = 4*faces[i+1], c = 4*faces[i+2];
        const ax = seen[a], ay = seen[a+1], ux = seen[b]-ax, uy = seen[b+1]-ay, vx = seen[c]-ax, vy = seen[c+1]-ay;
        const size = ux * vy - uy * vx;
        if (size >= 0) continue;
        const x0 = Math.max(0, Math.ceil(Math.min(ax, ax+ux, ax+vx))), x1 = Math.min(W-1, Math.floor(Math.max(ax, ax+ux, ax+vx)));
        const y0 = Math.max(0, Math.ceil(Math.min(ay, ay+uy, ay+vy))), y1 = Math.min(H-1, Math.floor(Math.max(ay, ay+uy, ay+vy)));
        for (let y = y0; y <= y1; y++)
          for (let x = x0; x <= x1; x++) {
            const g = ((x-ax) * vy - (y-ay) * vx) / size, k = (ux * (y-ay) - uy * (x-ax)) / size, f = 1 - g - k;
            if (f < 0 || g < 0 || k < 0) continue;
            const at = y * W + x, z = f * seen[a+2] + g * seen[b+2] + k * seen[c+2];
            // A region shows through what is less than a millimetre in front of it: meshes are made of chords.
            if (z + (cover ? 1 : 0) <= depth[at] || (cover && covered[at])) continue;
            const s = f * seen[a+3] + g * seen[b+3] + k * seen[c+3];
            for (let n = 0; n < 3; n++) {
              const value = s * color[n], below = pixels[4*at+n];
              pixels[4*at+n] = cover ? below + cover * (value - below) : value;
            }
            pixels[4*at+3] = 255;
            if (cover) covered[at] = 1; else depth[at] = z;
          }
      }
    }
    for (const link of links) paint(link, 0);
    if (region) paint(region, 0.75);
    ink.putImageData(image, 0, 0);
    canvas.width = w * ratio; canvas.height = h * ratio;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, w, h);
    context.drawImage(buffer, 0, 0, w, h);
    const dots = view.dots || [];
    for (let i = 0; i < dots.length; i += 4) {
      const q = project(dots.slice(i, i + 3));
      context.fillStyle = dots[i+3]; context.strokeStyle = "#111";
      context.beginPath(); context.arc(q[0], q[1], 4, 0, 7); context.fill(); context.stroke();
    }
    if (view.arrow) arrow(project(view.arrow), project(view.point));
  }
  function arrow(a, b) {
    const t = Math.atan2(b[1] - a[1], b[0] - a[0]);
    const near = [b[0] - 9 * Math.cos(t), b[1] - 9 * Math.sin(t)];
    for (const [color, grow] of [["#fff", 2], [view.color, 0]]) {
      context.strokeStyle = context.fillStyle = color; context.lineJoin = "round";
      context.lineWidth = 3 + 2 * grow;
      context.beginPath(); context.moveTo(a[0], a[1]); context.lineTo(near[0], near[1]); context.stroke();
      context.lineWidth = Math.max(1, 2 * grow); context.beginPath(); context.moveTo(b[0], b[1]);
      for (const lean of [-0.38, 0.38])
        context.lineTo(b[0] - 15 * Math.cos(t + lean), b[1] - 15 * Math.sin(t + lean));
      context.closePath(); context.stroke(); context.fill();
    }
  }
  let from = null, waiting = false;
  const redraw = () => {
    if (waiting) return;
    waiting = true; requestAnimationFrame(() => { waiting = false; draw(); });
  };
  const turn = (aside, higher) => {
    azimuth -= aside; elevation = Math.max(-1.5, Math.min(1.5, elevation + higher)); redraw();
  };
  canvas.tabIndex = 0;
  canvas.onpointerdown = e => { from = [e.clientX, e.clientY]; canvas.setPointerCapture(e.pointerId); };
  canvas.onpointerup = canvas.onpointercancel = () => { from = null; };
  canvas.onpointermove = e => {
    if (!from) return;
    turn((e.clientX - from[0]) * 0.01, (e.clientY - from[1]) * 0.01);
    from = [e.clientX, e.clientY];
  };
  canvas.onwheel = e => {
    if (document.activeElement !== canvas) return;
    e.preventDefault(); zoom *= Math.exp(-e.deltaY * 0.001); redraw();
  };
  canvas.onkeydown = e => {
    const turns = {ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1]};
    const zooms = {"+": 1.1, "=": 1.1, "-": 1 / 1.1};
    if (e.ctrlKey || e.altKey || e.metaKey || !(e.key in turns || e.key in zooms)) return;
    e.preventDefault();
    if (e.key in turns) turn(...turns[e.key]); else { zoom *= zooms[e.key]; redraw(); }
  };
  window.addEventListener("resize", redraw);
  draw();
}

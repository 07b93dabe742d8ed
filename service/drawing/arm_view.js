// Draws an arm on a 2D canvas, farthest triangles first; dragging turns it, the wheel zooms.
function drawArm(canvas, geometry, view) {
  const up = view.up, helper = Math.abs(up[0]) < 0.6 ? [1, 0, 0] : [0, 1, 0];
  const cross = (a, b) => [a[1]*b[2]-a[2]*b[1], a[2]*b[0]-a[0]*b[2], a[0]*b[1]-a[1]*b[0]];
  const dot = (a, b) => a[0]*b[0] + a[1]*b[1] + a[2]*b[2];
  const unit = a => { const l = Math.hypot(...a) || 1; return a.map(x => x / l); };
  const side = unit(cross(up, helper)), front = cross(side, up);
  let low = [1e9, 1e9, 1e9], high = [-1e9, -1e9, -1e9];
  const links = geometry.map((link, k) => {
    const p = view.poses[k], v = link.vertices, out = new Float32Array(v.length);
    for (let i = 0; i < v.length; i += 3)
      for (let r = 0; r < 3; r++) {
        const x = p[r] + p[3+3*r]*v[i] + p[4+3*r]*v[i+1] + p[5+3*r]*v[i+2];
        out[i+r] = x; low[r] = Math.min(low[r], x); high[r] = Math.max(high[r], x);
      }
    const c = parseInt(link.color.slice(1), 16);
    return {points: out, faces: link.faces, color: [c >> 16, c >> 8 & 255, c & 255]};
  });
  const center = low.map((x, i) => (x + high[i]) / 2);
  // Looks at the contact from the side that it is on.
  let azimuth = 0.9, elevation = 0.35, zoom = 1;
  if (view.arrow) {
    const d = [0, 1, 2].map(i => view.arrow[i] - view.point[i]);
    azimuth = Math.atan2(dot(d, side), dot(d, front)) + 0.6;
    elevation = Math.max(-0.2, Math.min(0.9, Math.asin(dot(unit(d), up)) * 0.5 + 0.3));
  }
  // The whole arm fits into the picture as it is seen at first.
  const toward0 = [0, 1, 2].map(i => Math.cos(elevation) * (Math.cos(azimuth) * front[i] + Math.sin(azimuth) * side[i]) + Math.sin(elevation) * up[i]);
  const right0 = unit(cross(up, toward0)), top0 = cross(toward0, right0);
  let wide = 1, tall = 1;
  for (const points of [...links.map(link => link.points), view.arrow || []])
    for (let i = 0; i < points.length; i += 3) {
      const d = [0, 1, 2].map(k => points[i + k] - center[k]);
      wide = Math.max(wide, Math.abs(dot(d, right0))); tall = Math.max(tall, Math.abs(dot(d, top0)));
    }
  const context = canvas.getContext("2d");
  function draw() {
    const ratio = window.devicePixelRatio || 1, w = canvas.clientWidth, h = canvas.clientHeight;
    canvas.width = w * ratio; canvas.height = h * ratio;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, w, h);
    const ca = Math.cos(azimuth), sa = Math.sin(azimuth), ce = Math.cos(elevation), se = Math.sin(elevation);
    const toward = [0, 1, 2].map(i => ce * (ca * front[i] + sa * side[i]) + se * up[i]);
    const right = unit(cross(up, toward)), top = cross(toward, right);
    const scale = 0.46 * zoom * Math.min(w / wide, h / tall);
    const project = p => {
      const d = [p[0]-center[0], p[1]-center[1], p[2]-center[2]];
      return [w / 2 + scale * dot(d, right), h / 2 - scale * dot(d, top), dot(d, toward)];
    };
    const light = unit([0, 1, 2].map(i => toward[i] + 0.6 * top[i] - 0.4 * right[i]));
    const shapes = [];
    for (const link of links) {
      const p = link.points, seen = [];
      for (let i = 0; i < p.length; i += 3) seen.push(project([p[i], p[i+1], p[i+2]]));
      for (let i = 0; i < link.faces.length; i += 3) {
        const [a, b, c] = [link.faces[i], link.faces[i+1], link.faces[i+2]];
        const [A, B, C] = [seen[a], seen[b], seen[c]];
        if ((B[0]-A[0]) * (C[1]-A[1]) - (B[1]-A[1]) * (C[0]-A[0]) >= 0) continue;
        const at = k => [p[3*k], p[3*k+1], p[3*k+2]];
        const u = at(a), n = unit(cross(at(b).map((x, r) => x - u[r]), at(c).map((x, r) => x - u[r])));
        const s = 0.45 + 0.55 * Math.max(0, dot(n, light));
        shapes.push([(A[2] + B[2] + C[2]) / 3, A, B, C, link.color.map(x => Math.round(x * s))]);
      }
    }
    shapes.sort((a, b) => a[0] - b[0]);
    for (const [, A, B, C, color] of shapes) {
      context.fillStyle = context.strokeStyle = `rgb(${color})`;
      context.beginPath(); context.moveTo(A[0], A[1]); context.lineTo(B[0], B[1]);
      context.lineTo(C[0], C[1]); context.closePath(); context.fill(); context.stroke();
    }
    const dots = view.dots || [];
    for (let i = 0; i < dots.length; i += 4) {
      const q = project(dots.slice(i, i + 3));
      context.fillStyle = `hsla(${60 - 60 * dots[i+3]}, 100%, 50%, 0.8)`;
      context.strokeStyle = "#111";
      context.beginPath(); context.arc(q[0], q[1], 3.5, 0, 7); context.fill(); context.stroke();
    }
    if (view.region) {
      context.beginPath();
      for (let i = 0; i < view.region.length; i += 3) {
        const q = project(view.region.slice(i, i + 3));
        i ? context.lineTo(q[0], q[1]) : context.moveTo(q[0], q[1]);
      }
      context.closePath();
      context.fillStyle = "rgba(255,255,255,0.55)"; context.fill();
      context.strokeStyle = "#111"; context.lineWidth = 1.2; context.stroke(); context.lineWidth = 1;
    }
    if (view.arrow) {
      const a = project(view.arrow), b = project(view.point);
      const t = Math.atan2(b[1] - a[1], b[0] - a[0]);
      for (const [color, width] of [["#fff", 6], ["#d50000", 3]]) {
        context.strokeStyle = context.fillStyle = color; context.lineWidth = width;
        context.beginPath(); context.moveTo(a[0], a[1]); context.lineTo(b[0], b[1]); context.stroke();
      }
      context.lineWidth = 1; context.beginPath(); context.moveTo(b[0], b[1]);
      context.lineTo(b[0] - 13 * Math.cos(t - 0.4), b[1] - 13 * Math.sin(t - 0.4));
      context.lineTo(b[0] - 13 * Math.cos(t + 0.4), b[1] - 13 * Math.sin(t + 0.4));
      context.closePath(); context.fill();
    } else if (view.point) {
      const b = project(view.point);
      context.fillStyle = "#d50000"; context.beginPath(); context.arc(b[0], b[1], 5, 0, 7); context.fill();
    }
  }
  let from = null;
  canvas.onpointerdown = e => { from = [e.clientX, e.clientY]; canvas.setPointerCapture(e.pointerId); };
  canvas.onpointerup = () => { from = null; };
  canvas.onpointermove = e => {
    if (!from) return;
    azimuth -= (e.clientX - from[0]) * 0.01;
    elevation = Math.max(-1.5, Math.min(1.5, elevation + (e.clientY - from[1]) * 0.01));
    from = [e.clientX, e.clientY]; draw();
  };
  canvas.onwheel = e => { e.preventDefault(); zoom *= Math.exp(-e.deltaY * 0.001); draw(); };
  window.addEventListener("resize", draw);
  draw();
}

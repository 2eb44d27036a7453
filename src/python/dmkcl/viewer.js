"use strict";
// Viewer of a cut locus: density, distance, potential or the locus' strength in colour, lines of equal distance, the
// locus, the source, minimal geodesics of the point that is clicked.
(() => {
const element = id => document.getElementById(id);
const canvas = element("view");
const data = JSON.parse(element("data").textContent);
const gl = canvas.getContext("webgl2", {antialias: true, alpha: false});
if (!gl) {
    element("failed").hidden = false;
    element("failed").textContent = "This browser gives no WebGL 2, which the picture needs.";
    return;
}

// ---- data -----------------------------------------------------------------------------------
function bytes(base64) {
    const text = atob(base64), out = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++) out[i] = text.charCodeAt(i);
    return out.buffer;
}
// In arrays the mesh's size is the unit of all lengths, mu and u among them, as single precision needs.
const inSizes = length => length / data.size;
const xyz = new Float32Array(bytes(data.xyz)), faces = new Uint32Array(bytes(data.faces));
const mu = new Float32Array(bytes(data.mu)), distance = new Float32Array(bytes(data.distance));
const potential = new Float32Array(bytes(data.potential));
const locus = new Float32Array(bytes(data.locus)), edges = new Uint32Array(bytes(data.edges));
const locusFaces = new Uint32Array(bytes(data.locus_faces)); // the triangle that each of its vertices lies in
const strength = new Float32Array(bytes(data.strength)).map(s => s < 0 ? Infinity : s);
const colours = new Uint8Array(bytes(data.colours));
// How geodesics arrive at each vertex: the direction back, in its chart; the last pseudo-source, or -1; the
// direction at the source.
const back = new Float32Array(bytes(data.back)), pseudoSource = new Int32Array(bytes(data.pseudo_source));
const leaving = new Float32Array(bytes(data.leaving));

// What colours can show: values of the surface (null: none), their range, whether a logarithmic scale can be chosen.
const quantities = {
    density: {name: "density \u03bc", range: data.range, canLog: true},
    distance: {name: "distance", range: [0, data.top], canLog: false},
    potential: {name: "potential u", range: data.depths, canLog: false},
    strength: {name: "strength", range: data.strengths, canLog: false, isLog: true},
};

// Normal of each vertex: the sum of its triangles' normals, as long as their areas.
function normals() {
    const sum = new Float32Array(xyz.length);
    for (let i = 0; i < faces.length; i += 3) {
        const a = 3 * faces[i], b = 3 * faces[i + 1], c = 3 * faces[i + 2];
        for (let k = 0; k < 3; k++) {
            const l = (k + 1) % 3, m = (k + 2) % 3;
            const n = (xyz[b + l] - xyz[a + l]) * (xyz[c + m] - xyz[a + m])
                - (xyz[b + m] - xyz[a + m]) * (xyz[c + l] - xyz[a + l]);
            sum[a + k] += n, sum[b + k] += n, sum[c + k] += n;
        }
    }
    for (let i = 0; i < sum.length; i += 3) {
        const size = Math.hypot(sum[i], sum[i + 1], sum[i + 2]) || 1;
        sum[i] /= size, sum[i + 1] /= size, sum[i + 2] /= size;
    }
    return sum;
}

// Three corners for each triangle, as mu is constant in it: place, normal, distance, mu, potential.
function corners() {
    const normal = normals(), out = new Float32Array(9 * faces.length);
    for (let i = 0; i < faces.length; i++) {
        const v = faces[i];
        for (let k = 0; k < 3; k++) {
            out[9 * i + k] = xyz[3 * v + k];
            out[9 * i + 3 + k] = normal[3 * v + k];
        }
        out[9 * i + 6] = distance[v];
        out[9 * i + 7] = mu[Math.floor(i / 3)];
        out[9 * i + 8] = potential[v];
    }
    return out;
}

// For each edge of the locus its two ends and its strength; a locus that is a point: that point twice.
function segments() {
    const out = [], index = edges.length ? edges : locus.length ? [0, 0] : [];
    for (let i = 0; i < index.length; i += 2) {
        for (const v of [index[i], index[i + 1]]) out.push(...locus.subarray(3 * v, 3 * v + 3));
        out.push(edges.length ? Math.min(strength[i / 2], 1e30) : 1e30);
    }
    return new Float32Array(out);
}

// ---- programs -------------------------------------------------------------------------------
const surface = program(`
in vec3 place, normal; in float distance, mu, potential;
uniform mat4 view, screen;
out vec3 n, x; out float d, u; flat out float m;
void main() {
    vec4 seen = view * vec4(place, 1);
    n = mat3(view) * normal; x = seen.xyz; d = distance; m = mu; u = potential;
    gl_Position = screen * seen;
}`, `
in vec3 n, x; in float d, u; flat in float m;
uniform sampler2D colours; uniform vec2 range; uniform float logarithmic, spacing; uniform int shown;
out vec4 colour;
void main() {
    vec3 N = normalize(n), V = normalize(-x);
    if (dot(N, V) < 0.0) N = -N;
    float value = shown == 0 ? m : shown == 1 ? d : u;
    float t = (value - range.x) / (range.y - range.x);
    if (logarithmic > 0.5) t = log(max(value, 1e-30) / range.x) / log(range.y / range.x);
    vec3 base = shown == 3 ? vec3(0.93) : texture(colours, vec2(clamp(t, 0.002, 0.998), 0.5)).rgb;
    vec3 light = normalize(vec3(0.3, 0.5, 1.0));
    float gloss = pow(max(dot(reflect(-light, N), V), 0.0), 30.0);
    vec3 c = base * (0.42 + 0.6 * max(dot(N, light), 0.0)) + 0.12 * gloss;
    if (spacing > 0.0) {
        float k = d / spacing, width = fwidth(k);
        float line = 1.0 - smoothstep(0.6, 1.4, abs(fract(k + 0.5) - 0.5) / width);
        c = mix(c, vec3(0.2), 0.55 * line * (1.0 - smoothstep(0.15, 0.5, width)));
    }
    colour = vec4(c, 1);
}`);
// A ribbon of `width` pixels with round ends that faces the viewer, a little before the surface.
const ribbon = program(`
in vec3 from, to; in vec2 corner; in float strength;
uniform mat4 view, screen; uniform vec2 size, range; uniform float width, least, step;
out vec2 at; out float reach, s;
void main() {
    s = log(strength / range.x) / log(range.y / range.x);
    if (strength < least) {
        gl_Position = vec4(2, 2, 2, 1);
        return;
    }
    vec4 a = screen * view * vec4(from, 1), b = screen * view * vec4(to, 1);
    vec2 p = a.xy / a.w * size / 2.0, q = b.xy / b.w * size / 2.0;
    float l = distance(p, q);
    vec2 along = l > 1e-6 ? (q - p) / l : vec2(1, 0), across = vec2(-along.y, along.x);
    vec4 end = corner.x < 0.0 ? a : b;
    vec2 shift = width / 2.0 * (along * corner.x + across * corner.y);
    reach = l / width * 2.0;
    at = vec2(corner.x < 0.0 ? -1.0 : reach + 1.0, corner.y);
    gl_Position = vec4(end.xy + shift / size * 2.0 * end.w, end.z - step * end.w, end.w);
}`, `
in vec2 at; in float reach, s;
uniform vec3 ink; uniform sampler2D colours;
out vec4 colour;
void main() {
    vec3 c = ink.r < 0.0 ? texture(colours, vec2(clamp(0.15 + 0.85 * s, 0.002, 0.998), 0.5)).rgb : ink;
    float r = length(vec2(at.x - clamp(at.x, 0.0, reach), at.y));
    if (r > 1.0) discard;
    // Light across a ribbon, so that neighbours join; round on a ball, which has no length.
    float z = sqrt(1.0 - (reach > 0.01 ? at.y * at.y : r * r));
    colour = vec4(c * (0.55 + 0.5 * z) + 0.2 * pow(z, 12.0), 1);
}`);

function program(vertex, fragment) {
    const made = gl.createProgram();
    const head = "#version 300 es\nprecision highp float;\n";
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
        const shader = gl.createShader(kind);
        gl.shaderSource(shader, head + text);
        gl.compileShader(shader);
        gl.attachShader(made, shader);
        const log = gl.getShaderInfoLog(shader);
        if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(log);
    }
    gl.linkProgram(made);
    const log = gl.getProgramInfoLog(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(log);
    const uniforms = {};
    for (let i = 0; i < gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS); i++) {
        const name = gl.getActiveUniform(made, i).name;
        uniforms[name] = gl.getUniformLocation(made, name);
    }
    return {made, uniforms};
}

// An array of vertices; fields: [name, length, offset] in floats; each: 1 for one per instance.
function attributes(p, array, stride, fields, each) {
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, array, gl.STATIC_DRAW);
    for (const [name, length, offset] of fields) {
        const i = gl.getAttribLocation(p.made, name);
        if (i < 0) continue;
        gl.enableVertexAttribArray(i);
        gl.vertexAttribPointer(i, length, gl.FLOAT, false, 4 * stride, 4 * offset);
        gl.vertexAttribDivisor(i, each);
    }
}
// Ribbons: seven numbers each, two ends and the strength.
function ribbons(ends) {
    const made = gl.createVertexArray();
    gl.bindVertexArray(made);
    attributes(ribbon, ends, 7, [["from", 3, 0], ["to", 3, 3], ["strength", 1, 6]], 1);
    attributes(ribbon, new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]), 2, [["corner", 2, 0]], 0);
    return {made, n: ends.length / 7};
}
const polyline = points => ribbons(new Float32Array(
    points.slice(1).flatMap((p, i) => [...points[i], ...p, 1e30])));
const shape = gl.createVertexArray();
gl.bindVertexArray(shape);
const fields = [["place", 3, 0], ["normal", 3, 3], ["distance", 1, 6], ["mu", 1, 7], ["potential", 1, 8]];
attributes(surface, corners(), 9, fields, 0);
const cut = ribbons(segments());
const ball = polyline([data.source, data.source]);
let paths = [], picked = null; // what a click has chosen: ribbons
gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB8, 256, 1, 0, gl.RGB, gl.UNSIGNED_BYTE, colours);
gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);

// ---- camera: a turn (3 rows of a rotation), a distance, a shift on the screen -----------------
const cross = (a, b) => [
    a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = a => { const l = Math.hypot(...a) || 1; return a.map(x => x / l); };
let turn, away, shift;

// The camera looks at the source from outside, a little from the side and from above; above is z, or y where the surface
// faces z there. Of some such directions the first from which nothing hides the source.
function reset() {
    const front = unit(data.normal), up = Math.abs(front[2]) > 0.8 ? [0, 1, 0] : [0, 0, 1];
    const side = unit(cross(up, front));
    const views = [[0.5, 0.45], [-0.5, 0.45], [0, 0.8], [0.5, 1.5], [0, 3], [0, -3], [0, 0]];
    away = 1.45;
    shift = [0, 0];
    for (const [x, y] of views) {
        const behind = unit(front.map((f, k) => f + x * side[k] + y * up[k]));
        const right = unit(cross(up, behind));
        turn = [right, cross(behind, right), behind];
        const eye = behind.map(b => b * away);
        const hit = meet(eye, unit(data.source.map((p, k) => p - eye[k])));
        if (!hit || hit.far > Math.hypot(...data.source.map((p, k) => p - eye[k])) - 0.02) return;
    }
}
// Turn about the screen's own axes, then make the rows orthogonal again.
function rotate(x, y) {
    const about = (i, j, angle) => {
        const [c, s] = [Math.cos(angle), Math.sin(angle)], [a, b] = [turn[i], turn[j]];
        turn[i] = a.map((v, k) => c * v - s * b[k]);
        turn[j] = a.map((v, k) => s * v + c * b[k]);
    };
    about(2, 0, x);
    about(1, 2, y);
    turn[0] = unit(turn[0]);
    turn[2] = unit(cross(turn[0], turn[1]));
    turn[1] = cross(turn[2], turn[0]);
}
// Column-major, as WebGL wants them.
const viewMatrix = () => [0, 1, 2].flatMap(k => [turn[0][k], turn[1][k], turn[2][k], 0])
    .concat([shift[0], shift[1], -away, 1]);
function screenMatrix(aspect) {
    const f = 2.7 * Math.min(1, aspect), near = Math.max(0.01, away - 0.7), far = away + 0.7;
    return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1,
        0, 0, 2 * far * near / (near - far), 0];
}

// ---- drawing --------------------------------------------------------------------------------
let waiting = false, frames = 0;
function ask() {
    if (!waiting) requestAnimationFrame(draw);
    waiting = true;
}
function begin(p, size) {
    gl.useProgram(p.made);
    gl.uniformMatrix4fv(p.uniforms.view, false, viewMatrix());
    gl.uniformMatrix4fv(p.uniforms.screen, false, screenMatrix(size[0] / size[1]));
}
function drawRibbons(what, width, ink, least = 0, step = 0.004) {
    gl.bindVertexArray(what.made);
    gl.uniform1f(ribbon.uniforms.width, width * devicePixelRatio);
    gl.uniform1f(ribbon.uniforms.least, least);
    gl.uniform1f(ribbon.uniforms.step, step);
    gl.uniform3fv(ribbon.uniforms.ink, ink);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, what.n);
}
function drawLines() {
    const ink = chosen() === "strength" ? [-1, 0, 0] : [0.84, 0.10, 0.12];
    if (element("cut").checked) drawRibbons(cut, edges.length ? 5 : 12, ink, inSizes(leastStrength()));
    for (const path of paths) drawRibbons(path, 4, [1, 0.75, 0.1], 0, 0.005);
    if (picked) drawRibbons(picked, 12, [0.95, 0.95, 0.95], 0, 0.006);
    drawRibbons(ball, 16, [1, 0.75, 0.1], 0, 0.007);
}
function draw() {
    waiting = false;
    const size = [canvas.clientWidth, canvas.clientHeight]
        .map(s => Math.max(1, Math.round(s * devicePixelRatio)));
    if (canvas.width !== size[0] || canvas.height !== size[1]) [canvas.width, canvas.height] = size;
    gl.viewport(0, 0, ...size);
    gl.enable(gl.DEPTH_TEST);
    gl.clearColor(1, 1, 1, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    begin(surface, size);
    gl.uniform1i(surface.uniforms.shown, Object.keys(quantities).indexOf(chosen()));
    gl.uniform2fv(surface.uniforms.range, scale().range.map(inSizes));
    gl.uniform1f(surface.uniforms.logarithmic, scale().isLog ? 1 : 0);
    gl.uniform1f(surface.uniforms.spacing, element("lines").checked ? inSizes(lineSpacing()) : 0);
    gl.bindVertexArray(shape);
    gl.drawArrays(gl.TRIANGLES, 0, faces.length);
    begin(ribbon, size);
    gl.uniform2fv(ribbon.uniforms.size, size);
    gl.uniform2fv(ribbon.uniforms.range, data.strengths.map(inSizes));
    drawLines();
    if (element("hidden").checked) { // what lies behind shines through
        gl.enable(gl.BLEND);
        gl.blendFunc(gl.CONSTANT_ALPHA, gl.ONE_MINUS_CONSTANT_ALPHA);
        gl.blendColor(0, 0, 0, 0.25);
        gl.depthFunc(gl.GREATER);
        gl.depthMask(false);
        drawLines();
        gl.disable(gl.BLEND);
        gl.depthFunc(gl.LESS);
        gl.depthMask(true);
    }
    const error = gl.getError();
    if (error) console.error("WebGL error " + error);
    document.documentElement.dataset.frames = ++frames;
}

// ---- scales -----------------------------------------------------------------------------------
const chosen = () => element("colour").value;
// The scale in use: ends, whether logarithmic. A linear one of the density begins at 0.
function scale() {
    const q = quantities[chosen()], isLog = q.isLog || q.canLog && element("log").checked;
    return {range: q.canLog && !isLog ? [0, q.range[1]] : q.range, isLog};
}
const short = x => x === 0 ? "0" : Math.abs(x) >= 1e5 || Math.abs(x) < 1e-3
    ? x.toExponential(3).replace(/\.?0+e/, "e") : String(Number(x.toPrecision(4)));
// 1, 2 or 5 times a power of ten, at least x.
function round(x) {
    const power = 10 ** Math.floor(Math.log10(x));
    return [1, 2, 5, 10].find(k => k * power >= 0.999999 * x) * power;
}
const lineSpacing = () => round(data.top / 30);
// Round numbers between the ends: by a round step, or of each decade 1 (and 2 and 5 where there are few).
function ticks([low, high], isLog) {
    const found = [];
    if (isLog) {
        const decades = Math.log10(high / low), steps = decades > 6 ? [1] : decades > 2.5 ? [1, 3] : [1, 2, 5];
        for (let d = Math.floor(Math.log10(low)); d <= Math.log10(high); d++) {
            for (const k of steps) found.push(Number((k * 10 ** d).toPrecision(6)));
        }
        return found.filter(t => t >= low && t <= high);
    }
    const step = round((high - low) / 6);
    for (let k = Math.ceil(low / step); k * step <= high; k++) found.push(Number((k * step).toPrecision(6)));
    return found;
}
const place = (value, [low, high], isLog) =>
    isLog ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low);
const colourOf = i => `rgb(${colours.subarray(3 * i, 3 * i + 3).join()})`;
// On the bar of the strength the palest colours are left out: lines are thin.
const barColour = t => Math.round(255 * (chosen() === "strength" ? 0.15 + 0.85 * t : t));
function bar() {
    const strip = document.querySelector("#bar canvas").getContext("2d"), {range, isLog} = scale();
    for (let i = 0; i < 256; i++) {
        strip.fillStyle = colourOf(barColour(i / 255));
        strip.fillRect(0, 255 - i, 1, 1);
    }
    document.querySelector("#bar b").textContent = quantities[chosen()].name;
    element("ticks").replaceChildren(...ticks(range, isLog).map(value => {
        const tick = document.createElement("span");
        tick.textContent = short(value);
        tick.style.bottom = 100 * place(value, range, isLog) + "%";
        return tick;
    }));
    element("log").disabled = !quantities[chosen()].canLog;
    element("spacing").textContent = short(lineSpacing());
}
// The slider goes over the logarithm of the strengths there are; at its left end all branches are shown.
function leastStrength() {
    const [low, high] = data.strengths;
    return low * (high / low) ** (element("least").value / 1000);
}
function showStrength() {
    element("strength").textContent = short(leastStrength());
}

// ---- the mesh: neighbours, rays, geodesics ----------------------------------------------------
const point = v => [xyz[3 * v], xyz[3 * v + 1], xyz[3 * v + 2]];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const along = (a, d, t) => [a[0] + t * d[0], a[1] + t * d[1], a[2] + t * d[2]];
// Half-edge 3 t + k lies opposite corner k of triangle t; -1: none on the other side. Made at the first click.
let twin = null, firstCorner = null;
const next = h => h % 3 === 2 ? h - 2 : h + 1, previous = h => h % 3 === 0 ? h + 2 : h - 1;
function findTwins() {
    twin = new Int32Array(faces.length).fill(-1);
    firstCorner = new Int32Array(distance.length).fill(-1);
    const open = new Map(), n = distance.length;
    for (let h = 0; h < faces.length; h++) {
        const [a, b] = [faces[next(h)], faces[previous(h)]], other = open.get(b * n + a);
        if (other === undefined) open.set(a * n + b, h);
        else twin[h] = other, twin[other] = h;
    }
    // Directions at a vertex count from its first corner: the clockwise-most at a border, else the first there is.
    for (let c = 0; c < faces.length; c++) {
        if (twin[previous(c)] < 0 || firstCorner[faces[c]] < 0) firstCorner[faces[c]] = c;
    }
}
// Where a ray meets the surface first: {far, face, weight}, or null. (Moeller and Trumbore.)
function meet(from, ray) {
    let best = null;
    for (let f = 0; f < faces.length; f += 3) {
        const a = point(faces[f]), e = minus(point(faces[f + 1]), a), g = minus(point(faces[f + 2]), a);
        const p = cross(ray, g), size = dot(e, p);
        if (size === 0) continue;
        const o = minus(from, a), s = dot(o, p) / size;
        if (s < 0 || s > 1) continue;
        const q = cross(o, e), t = dot(ray, q) / size, far = dot(g, q) / size;
        if (t >= 0 && s + t <= 1 && far > 0 && !(best && best.far <= far)) {
            best = {far, face: f / 3, weight: [1 - s - t, s, t], at: along(from, ray, far)};
        }
    }
    return best;
}
// What lies under a place of the window.
function under(x, y) {
    const box = canvas.getBoundingClientRect(), aspect = box.width / box.height;
    const f = 2.7 * Math.min(1, aspect);
    const seen = [(2 * (x - box.left) / box.width - 1) * aspect / f, (1 - 2 * (y - box.top) / box.height) / f, -1];
    const back = v => [0, 1, 2].map(k => turn[0][k] * v[0] + turn[1][k] * v[1] + turn[2][k] * v[2]);
    return meet(back([-shift[0], -shift[1], away]), unit(back(seen)));
}
// The straight line from vertex v over the triangles, in the direction that its geodesic arrives from, of this length.
function trace(v, length) {
    let c = firstCorner[v], sum = 0;
    const corner = c => {
        const [a, b] = [minus(point(faces[next(c)]), point(v)), minus(point(faces[previous(c)]), point(v))];
        return Math.atan2(Math.hypot(...cross(a, b)), dot(a, b));
    };
    for (let k = 0; k < 1000; k++) { // the corner that the direction lies in
        const wide = corner(c);
        if (back[v] <= sum + wide) break;
        const on = twin[next(c)];
        if (on < 0 || next(on) === firstCorner[v]) break;
        sum += wide;
        c = next(on);
    }
    const e = unit(minus(point(faces[next(c)]), point(v)));
    const n = unit(cross(e, minus(point(faces[previous(c)]), point(v))));
    let ray = along(e.map(x => x * Math.cos(back[v] - sum)), cross(n, e), Math.sin(back[v] - sum));
    let at = point(v), sides = [c];
    const points = [at];
    for (let k = 0; k < 100000 && length > 0; k++) {
        // Leave the triangle through one of the sides that are open.
        let exit = null;
        for (const h of sides) {
            const a = point(faces[next(h)]), b = point(faces[previous(h)]), side = minus(b, a);
            const normal = cross(minus(point(faces[h]), a), side), out = cross(normal, side); // in the plane, outwards
            const speed = dot(ray, out);
            const t = dot(minus(a, at), out) / speed;
            if (Math.abs(speed) > 0 && t * speed * speed >= 0 && t > -1e-12 && !(exit && exit.t <= t)) exit = {t, h, side};
        }
        if (!exit || exit.t >= length) break;
        at = along(at, ray, exit.t);
        length -= exit.t;
        points.push(at);
        const over = twin[exit.h];
        if (over < 0) break;
        // Unfolded: the same components along the side and across it, in the next triangle's plane.
        const s = unit(exit.side), onward = minus(point(faces[over]), point(faces[next(over)]));
        const inward = unit(along(onward, s, -dot(onward, s))), part = dot(ray, s);
        ray = along(s.map(x => x * part), inward, Math.sqrt(Math.max(0, 1 - part * part)));
        sides = [next(over), previous(over)];
    }
    return points;
}
// The minimal geodesic from vertex v back to the source: straight between pseudo-sources.
function geodesic(v) {
    let points = [];
    for (let k = 0; k < 10000; k++) {
        const stop = pseudoSource[v];
        const before = stop < 0 ? 0 : distance[stop];
        points = points.concat(trace(v, distance[v] - before));
        if (stop < 0) break;
        v = stop;
    }
    points.push(data.source);
    return points;
}
// Whether a branch that is shown passes through one of these triangles.
function onLocus(triangles) {
    if (!edges.length) return locusFaces.some(f => triangles.has(f));
    const least = inSizes(leastStrength());
    return edges.some((v, i) => triangles.has(locusFaces[v]) && strength[i >> 1] >= least);
}
// Corners around, whose geodesics leave the source in clearly different directions: one, or more on the locus. Near the
// source and where geodesics come together directions of neighbours differ without a locus between them.
function families(hit) {
    const near = new Set(), triangles = new Set([hit.face]);
    for (let k = 0; k < 3; k++) {
        const over = twin[3 * hit.face + k];
        near.add(faces[3 * hit.face + k]);
        if (over >= 0) near.add(faces[over]), triangles.add(Math.floor(over / 3));
    }
    const far = v => Math.hypot(...minus(point(v), hit.at)), found = [];
    const apart = (a, b) => { // of a full turn
        const d = Math.abs(leaving[a] - leaving[b]) % data.turn;
        return Math.min(d, data.turn - d);
    };
    for (const v of [...near].filter(v => distance[v] > 0).sort((a, b) => far(a) - far(b))) {
        if (found.every(w => apart(v, w) > 0.25)) found.push(v);
    }
    return onLocus(triangles) ? found : found.slice(0, 1);
}
function forget() {
    for (const old of [...paths, ...picked ? [picked] : []]) gl.deleteVertexArray(old.made);
    [paths, picked] = [[], null];
    element("picked").textContent = "";
    element("picked").dataset.lengths = "[]";
}
function pick(x, y) {
    const hit = under(x, y);
    forget();
    if (hit && reached(hit)) {
        if (!twin) findTwins();
        const ends = families(hit);
        const lines = ends.map(geodesic), long = line => data.size * line.slice(1).reduce(
            (sum, p, i) => sum + Math.hypot(...minus(p, line[i])), 0);
        paths = lines.map(polyline);
        element("picked").dataset.lengths = JSON.stringify(lines.map(long));
        picked = polyline([hit.at, hit.at]);
        element("picked").textContent = ends.length === 1
            ? `Minimal geodesic of vertex ${ends[0]}, length ${short(data.size * distance[ends[0]])}.`
            : `On the cut locus: minimal geodesics of the vertices ${ends.join(", ")}, lengths `
                + ends.map(v => short(data.size * distance[v])).join(", ") + ".";
    }
    ask();
}
const corner = (hit, values) => [0, 1, 2].reduce((sum, k) => sum + hit.weight[k] * values[faces[3 * hit.face + k]], 0);
// The source itself is a corner at the distance 0; where it is not joined to, all three are.
const reached = hit => data.all || [0, 1, 2].some(k => distance[faces[3 * hit.face + k]] > 0);
function showValues(x, y) {
    const hit = under(x, y), tip = element("tip");
    tip.hidden = !hit;
    if (!hit) return;
    const lines = reached(hit) ? [
        `distance ${short(data.size * corner(hit, distance))}`, `density ${short(data.size * mu[hit.face])}`,
        `potential ${short(data.size * corner(hit, potential))}`] : ["not joined to the source"];
    tip.replaceChildren(...[...lines, `triangle ${hit.face}`].map(line => {
        const row = document.createElement("div");
        row.textContent = line;
        return row;
    }));
    tip.style.left = Math.min(x + 14, innerWidth - 150) + "px";
    tip.style.top = Math.min(y + 14, innerHeight - 90) + "px";
}

// ---- hands ----------------------------------------------------------------------------------
const held = new Map(); // pointers on the canvas: id -> [x, y]
function spread() {
    const [a, b] = [...held.values()];
    return Math.hypot(a[0] - b[0], a[1] - b[1]);
}
const nearer = factor => { away = Math.min(8, Math.max(0.3, away * factor)); ask(); };
let pressed = null; // where a press began that may become a click
const middle = () => [0, 1].map(k => [...held.values()].reduce((sum, p) => sum + p[k], 0) / held.size);
let hovering = null;
canvas.onpointerdown = event => {
    canvas.setPointerCapture(event.pointerId);
    held.set(event.pointerId, [event.clientX, event.clientY]);
    pressed = held.size === 1 ? [event.clientX, event.clientY] : null;
    element("tip").hidden = true;
};
canvas.onpointermove = event => {
    const before = held.get(event.pointerId);
    if (!before) {
        if (!hovering) requestAnimationFrame(() => { showValues(...hovering); hovering = null; });
        hovering = [event.clientX, event.clientY];
        return;
    }
    if (pressed && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > 4) pressed = null;
    const centre = middle();
    const [dx, dy] = [event.clientX - before[0], event.clientY - before[1]];
    const wide = held.size > 1 ? spread() : 0;
    held.set(event.pointerId, [event.clientX, event.clientY]);
    const scale = 1 / canvas.clientHeight;
    const move = (x, y) => { shift = [shift[0] + 0.74 * away * scale * x, shift[1] - 0.74 * away * scale * y]; };
    if (held.size > 1) { // two fingers: nearer, and moved with them
        nearer(wide / Math.max(1, spread()));
        move(...middle().map((m, k) => m - centre[k]));
    } else if (event.shiftKey || event.buttons & 6) move(dx, dy);
    else if (!pressed) rotate(5 * scale * dx, 5 * scale * dy);
    ask();
};
canvas.onpointerup = event => {
    held.delete(event.pointerId);
    if (!pressed || event.button > 0) return;
    pick(...pressed);
    if (event.pointerType === "touch") showValues(...pressed);
    pressed = null;
};
canvas.onpointercancel = event => held.delete(event.pointerId);
canvas.onpointerleave = event => { // a finger that is lifted leaves, too: what it has asked for stays
    if (event.pointerType !== "touch") element("tip").hidden = true;
};
canvas.oncontextmenu = event => event.preventDefault();
canvas.addEventListener("wheel", event => {
    event.preventDefault();
    nearer(Math.exp(0.001 * event.deltaY * (event.deltaMode ? 30 : 1)));
}, {passive: false});
canvas.ondblclick = () => { forget(); reset(); ask(); };
const arrows = {
    ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1]};
canvas.onkeydown = event => {
    const step = arrows[event.key];
    if (step) rotate(...step), ask();
    else if (event.key === "+") nearer(0.9);
    else if (event.key === "-") nearer(1 / 0.9);
};
for (const id of ["colour", "log", "lines", "cut", "hidden"]) element(id).onchange = () => { bar(); ask(); };
element("least").oninput = () => { showStrength(); ask(); };
// The picture with its title and scale.
function picture() {
    draw(); // what is drawn is there until the browser shows the next frame
    const made = document.createElement("canvas"), ink = made.getContext("2d"), r = devicePixelRatio;
    [made.width, made.height] = [canvas.width, canvas.height];
    ink.drawImage(canvas, 0, 0);
    ink.scale(r, r);
    const wide = canvas.width / r, {range, isLog} = scale();
    ink.fillStyle = "#222";
    ink.font = "600 18px sans-serif";
    ink.fillText(document.title, 16, 30);
    ink.font = "14px sans-serif";
    ink.textAlign = "right";
    ink.fillText(quantities[chosen()].name, wide - 16, 28);
    for (const value of ticks(range, isLog)) {
        ink.fillText(short(value), wide - 42, 245 - 200 * place(value, range, isLog));
    }
    for (let i = 0; i < 200; i++) {
        ink.fillStyle = colourOf(barColour(i / 199));
        ink.fillRect(wide - 34, 239 - i, 18, 1.5);
    }
    return made;
}
element("save").onclick = () => {
    const link = document.createElement("a");
    link.download = document.title + ".png";
    link.href = picture().toDataURL("image/png");
    link.click();
};
window.onresize = ask;
canvas.addEventListener("webglcontextlost", () => location.reload());

{ // the slider begins at the strength of the result
    const [low, high] = data.strengths, least = element("least");
    least.value = Math.round(1000 * Math.log(Math.max(data.least, low) / low) / Math.log(high / low));
    element("branches").hidden = !strength.some(s => s < Infinity);
}
showStrength();
bar();
reset();
ask();
})();

"use strict";
// Viewer of a cut locus: density in colour, lines of equal distance, the locus, the source.
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
const xyz = new Float32Array(bytes(data.xyz)), faces = new Uint32Array(bytes(data.faces));
const mu = new Float32Array(bytes(data.mu)), distance = new Float32Array(bytes(data.distance));
const locus = new Float32Array(bytes(data.locus)), edges = new Uint32Array(bytes(data.edges));
const colours = new Uint8Array(bytes(data.colours));

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

// Three corners for each triangle, as mu is constant in it: place, normal, distance, mu.
function corners() {
    const normal = normals(), out = new Float32Array(8 * faces.length);
    for (let i = 0; i < faces.length; i++) {
        const v = faces[i];
        for (let k = 0; k < 3; k++) {
            out[8 * i + k] = xyz[3 * v + k];
            out[8 * i + 3 + k] = normal[3 * v + k];
        }
        out[8 * i + 6] = distance[v];
        out[8 * i + 7] = mu[Math.floor(i / 3)];
    }
    return out;
}

// For each edge of the locus its two ends; a locus that is a point: that point twice.
function segments() {
    const out = [], index = edges.length ? edges : locus.length ? [0, 0] : [];
    for (const v of index) out.push(...locus.subarray(3 * v, 3 * v + 3));
    return new Float32Array(out);
}

// ---- programs -------------------------------------------------------------------------------
const surface = program(`
in vec3 place, normal; in float distance, mu;
uniform mat4 view, screen;
out vec3 n, x; out float d; flat out float m;
void main() {
    vec4 seen = view * vec4(place, 1);
    n = mat3(view) * normal; x = seen.xyz; d = distance; m = mu;
    gl_Position = screen * seen;
}`, `
in vec3 n, x; in float d; flat in float m;
uniform sampler2D colours; uniform vec2 range; uniform float logarithmic, spacing;
out vec4 colour;
void main() {
    vec3 N = normalize(n), V = normalize(-x);
    if (dot(N, V) < 0.0) N = -N;
    float t = m / range.y;
    if (logarithmic > 0.5) t = log(max(m, 1e-30) / range.x) / log(range.y / range.x);
    vec3 base = texture(colours, vec2(clamp(t, 0.002, 0.998), 0.5)).rgb;
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
in vec3 from, to; in vec2 corner;
uniform mat4 view, screen; uniform vec2 size; uniform float width;
out vec2 at; out float reach;
void main() {
    vec4 a = screen * view * vec4(from, 1), b = screen * view * vec4(to, 1);
    vec2 p = a.xy / a.w * size / 2.0, q = b.xy / b.w * size / 2.0;
    float l = distance(p, q);
    vec2 along = l > 1e-6 ? (q - p) / l : vec2(1, 0), across = vec2(-along.y, along.x);
    vec4 end = corner.x < 0.0 ? a : b;
    vec2 shift = width / 2.0 * (along * corner.x + across * corner.y);
    reach = l / width * 2.0;
    at = vec2(corner.x < 0.0 ? -1.0 : reach + 1.0, corner.y);
    gl_Position = vec4(end.xy + shift / size * 2.0 * end.w, end.z - 0.004 * end.w, end.w);
}`, `
in vec2 at; in float reach;
uniform vec3 ink;
out vec4 colour;
void main() {
    float r = length(vec2(at.x - clamp(at.x, 0.0, reach), at.y));
    if (r > 1.0) discard;
    // Light across a ribbon, so that neighbours join; round on a ball, which has no length.
    float z = sqrt(1.0 - (reach > 0.01 ? at.y * at.y : r * r));
    colour = vec4(ink * (0.55 + 0.5 * z) + 0.2 * pow(z, 12.0), 1);
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
function ribbons(ends) {
    const made = gl.createVertexArray();
    gl.bindVertexArray(made);
    attributes(ribbon, ends, 6, [["from", 3, 0], ["to", 3, 3]], 1);
    attributes(ribbon, new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]), 2, [["corner", 2, 0]], 0);
    return {made, n: ends.length / 6};
}
const shape = gl.createVertexArray();
gl.bindVertexArray(shape);
const fields = [["place", 3, 0], ["normal", 3, 3], ["distance", 1, 6], ["mu", 1, 7]];
attributes(surface, corners(), 8, fields, 0);
const cut = ribbons(segments());
const ball = ribbons(new Float32Array([...data.source, ...data.source]));
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

// At first the source is in front, a little to the side, and z is up, or y where the source lies on the z
// axis.
function reset() {
    const p = Math.hypot(...data.source) > 0 ? data.source : [1, 0, 0];
    const up = Math.abs(p[2]) > 0.8 * Math.hypot(...p) ? [0, 1, 0] : [0, 0, 1];
    const side = unit(cross(up, p)), front = unit(p);
    const back = unit(front.map((x, k) => x + 0.5 * side[k] + 0.45 * up[k]));
    const right = unit(cross(up, back));
    turn = [right, cross(back, right), back];
    away = 1.45;
    shift = [0, 0];
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
function drawRibbons(what, width, ink) {
    gl.bindVertexArray(what.made);
    gl.uniform1f(ribbon.uniforms.width, width * devicePixelRatio);
    gl.uniform3fv(ribbon.uniforms.ink, ink);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, what.n);
}
function drawLines() {
    if (element("cut").checked) drawRibbons(cut, edges.length ? 5 : 12, [0.84, 0.10, 0.12]);
    drawRibbons(ball, 16, [1, 0.75, 0.1]);
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
    gl.uniform2fv(surface.uniforms.range, data.range);
    gl.uniform1f(surface.uniforms.logarithmic, element("log").checked ? 1 : 0);
    gl.uniform1f(surface.uniforms.spacing, element("lines").checked ? data.top / 21 : 0);
    gl.bindVertexArray(shape);
    gl.drawArrays(gl.TRIANGLES, 0, faces.length);
    begin(ribbon, size);
    gl.uniform2fv(ribbon.uniforms.size, size);
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

// ---- colour bar -----------------------------------------------------------------------------
function bar() {
    const strip = document.querySelector("#bar canvas").getContext("2d");
    for (let i = 0; i < 256; i++) {
        strip.fillStyle = `rgb(${colours.subarray(3 * i, 3 * i + 3).join()})`;
        strip.fillRect(0, 255 - i, 1, 1);
    }
    const [low, high] = data.range, isLog = element("log").checked, ticks = [];
    for (let i = 4; i >= 0; i--) ticks.push(isLog ? low * (high / low) ** (i / 4) : high * i / 4);
    element("ticks").replaceChildren(...ticks.map(value => {
        const tick = document.createElement("span");
        tick.textContent = Number(value.toPrecision(2)).toString();
        return tick;
    }));
}

// ---- hands ----------------------------------------------------------------------------------
const held = new Map(); // pointers on the canvas: id -> [x, y]
function spread() {
    const [a, b] = [...held.values()];
    return Math.hypot(a[0] - b[0], a[1] - b[1]);
}
const nearer = factor => { away = Math.min(8, Math.max(0.3, away * factor)); ask(); };
canvas.onpointerdown = event => {
    canvas.setPointerCapture(event.pointerId);
    held.set(event.pointerId, [event.clientX, event.clientY]);
};
canvas.onpointermove = event => {
    const before = held.get(event.pointerId);
    if (!before) return;
    const [dx, dy] = [event.clientX - before[0], event.clientY - before[1]];
    const wide = held.size > 1 ? spread() : 0;
    held.set(event.pointerId, [event.clientX, event.clientY]);
    const scale = 1 / canvas.clientHeight;
    if (held.size > 1) nearer(wide / Math.max(1, spread()));
    else if (event.shiftKey || event.buttons & 6) {
        shift = [shift[0] + 0.74 * away * scale * dx, shift[1] - 0.74 * away * scale * dy];
    } else rotate(5 * scale * dx, 5 * scale * dy);
    ask();
};
canvas.onpointerup = canvas.onpointercancel = event => held.delete(event.pointerId);
canvas.oncontextmenu = event => event.preventDefault();
canvas.addEventListener("wheel", event => {
    event.preventDefault();
    nearer(Math.exp(0.001 * event.deltaY * (event.deltaMode ? 30 : 1)));
}, {passive: false});
canvas.ondblclick = () => { reset(); ask(); };
const arrows = {
    ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1]};
canvas.onkeydown = event => {
    const step = arrows[event.key];
    if (step) rotate(...step), ask();
    else if (event.key === "+") nearer(0.9);
    else if (event.key === "-") nearer(1 / 0.9);
};
for (const id of ["log", "lines", "cut", "hidden"]) element(id).onchange = () => { bar(); ask(); };
element("save").onclick = () => {
    draw(); // the drawn picture is there until the browser shows the next one
    const link = document.createElement("a");
    link.download = document.title + ".png";
    link.href = canvas.toDataURL("image/png");
    link.click();
};
window.onresize = ask;
canvas.addEventListener("webglcontextlost", () => location.reload());

bar();
reset();
ask();
})();

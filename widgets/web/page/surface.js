// A mesh that follows its cages, drawn in the page with WebGL 2.
//
//     const surface = SegdeformSurface.create(canvas);   // null where WebGL 2 cannot do it
//     socket.onmessage = (event) => surface.receive(event.data);   // ArrayBuffer; "" or a reason
//
// The messages are those of messages.py and encoding.py.  W~ and the faces arrive once; a pose is
// the moves of the cage vertices.  A picture takes three passes, each in textures with a texel for
// every vertex, 1024 in a row:
//
//     positions   x = rest + s_i sum_j q_ij (p_j - p_rest_j) + offset
//     normals     the sum of (x_k - x) x (x_{k+1} - x) over the neighbours of a vertex, in order
//     picture     triangles, lit as the in-process view lights them
//
// The canvas is transparent where there is no mesh, so that it can lie over another picture.
// Several messages between two pictures are one picture: only the newest pose is drawn.
"use strict";

(() => {
  const MAGIC = 0x4d464453; // "SDFM"
  const VERSION = 3;
  const HEADER = 16;
  const SURFACE = 1, CAGES = 2, OFFSETS = 3, COLOURS = 4, LOOK = 5, MARKS = 6;
  const ROW = 1024; // texels in a row of a texture; a power of two
  const ROW_BITS = 10;
  const GROUP = 4; // weights in a texel
  const LOOK_NUMBERS = 37;
  const MARK_NUMBERS = 30;
  const LIGHTS = 4;
  const MOST_IN_SOFTWARE = 20000; // vertices drawn without a graphics processor
  const POSITION = 0, DIRECTION = 1, COLOUR = 2; // attributes of the body

  const HEAD = `#version 300 es
precision highp float; precision highp int;
precision highp sampler2D; precision highp isampler2D; precision highp usampler2D;
ivec2 texel(int k) { return ivec2(k & ${ROW - 1}, k >> ${ROW_BITS}); }
`;

  const WHOLE = HEAD + `
void main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0); }`;

  const POSITIONS = HEAD + `
uniform sampler2D rest;      // x, y, z at rest, and s
uniform usampler2D rows;     // first texel of weights, first group of cage vertices, groups
uniform isampler2D weights;  // q, four in a texel
uniform sampler2D cages;     // moves of four cage vertices in three texels, one above another
uniform isampler2D offsets;
uniform float offset_step;
out vec4 position;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec4 x = texelFetch(rest, at, 0);
  uvec4 row = texelFetch(rows, at, 0);
  int first = int(row.x), group = int(row.y), count = int(row.z);
  vec3 move = vec3(0.0);
  for (int k = 0; k < count; k++) {
    vec4 w = vec4(texelFetch(weights, texel(first + k), 0));
    int g = group + k;
    ivec2 c = ivec2(g & ${ROW - 1}, 3 * (g >> ${ROW_BITS}));
    move.x += dot(w, texelFetch(cages, c, 0));
    move.y += dot(w, texelFetch(cages, c + ivec2(0, 1), 0));
    move.z += dot(w, texelFetch(cages, c + ivec2(0, 2), 0));
  }
  vec3 offset = vec3(0.0);
  if (offset_step > 0.0) offset = offset_step * vec3(texelFetch(offsets, at, 0).xyz);
  position = vec4(x.xyz + x.w * move + offset, 1.0);
}`;

  const NORMALS = HEAD + `
uniform sampler2D positions;
uniform usampler2D fans;        // first texel of neighbours, texels, 1 for the opposite normal
uniform usampler2D neighbours;  // four in a texel; the vertex itself separates fans
out vec4 normal;
vec3 near(uint k) { return texelFetch(positions, texel(int(k)), 0).xyz; }
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  uvec4 fan = texelFetch(fans, at, 0);
  vec3 x = texelFetch(positions, at, 0).xyz, sum = vec3(0.0), last = vec3(0.0);
  int first = int(fan.x), count = int(fan.y);
  for (int k = 0; k < count; k++) {
    uvec4 next = texelFetch(neighbours, texel(first + k), 0);
    vec3 a = near(next.x) - x, b = near(next.y) - x, c = near(next.z) - x, d = near(next.w) - x;
    sum += cross(last, a) + cross(a, b) + cross(b, c) + cross(c, d);
    last = d;
  }
  float size = length(sum);
  if (fan.z == 1u) size = -size;
  normal = vec4(size == 0.0 ? vec3(0.0) : sum / size, 0.0);
}`;

  const BODY = HEAD + `
uniform mat4 view, projection;
in vec4 position, direction, colour;
out vec3 shade, normal;
void main() {
  gl_Position = projection * (view * position);
  normal = mat3(view) * direction.xyz;
  shade = colour.rgb;
}`;

  // Unrolled, since software draws a loop over lights at half the speed.
  const lit = (count) => HEAD + `
uniform vec3 directions[${LIGHTS}], strengths[${LIGHTS}];
uniform float ambient;
in vec3 shade, normal;
out vec4 pixel;
void main() {
  float side = gl_FrontFacing ? 1.0 : -1.0;
  vec3 n = normal * (side * inversesqrt(max(dot(normal, normal), 1e-30)));
  vec3 light = vec3(ambient);
${[...Array(count).keys()].map((k) =>
    `  light += max(dot(n, directions[${k}]), 0.0) * strengths[${k}];`).join("\n")}
  pixel = vec4(min(shade * light, 1.0), 1.0);
}`;

  // Lines and points of constant size: a quad for each, between start and end.
  const MARK = HEAD + `
uniform mat4 model, view, projection;
uniform vec4 plane;
uniform vec2 pixels;
uniform float size, lift;
in vec3 start, end;
out vec2 place;
out float along, side;
void main() {
  vec4 first = model * vec4(start, 1.0), last = model * vec4(end, 1.0);
  vec4 a = projection * (view * first), b = projection * (view * last);
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
  vec2 p = a.xy / a.w * pixels, q = b.xy / b.w * pixels;
  vec2 way = q - p;
  float far = length(way);
  vec2 t = far > 0.0 ? way / far : vec2(1.0, 0.0), across = vec2(-t.y, t.x);
  vec4 at = corner.x < 0.5 ? a : b;
  side = dot(plane, corner.x < 0.5 ? first : last);
  place = vec2(corner.x < 0.5 ? -size : far + size, (2.0 * corner.y - 1.0) * size);
  along = far;
  vec2 shift = (2.0 * corner.x - 1.0) * size * t + place.y * across;
  at.xy += shift / pixels * at.w;
  at.z -= lift * at.w;
  gl_Position = at;
}`;

  const FLAT = HEAD + `
uniform vec4 tint;
uniform float size;
in vec2 place;
in float along, side;
out vec4 pixel;
void main() {
  if (side < 0.0) discard;
  float away = length(vec2(place.x - clamp(place.x, 0.0, along), place.y));
  float inside = clamp(size - away, 0.0, 1.0);
  if (inside <= 0.0) discard;
  pixel = tint * inside;
}`;

  const PAINTED = HEAD + `
uniform mat4 model, view, projection;
uniform vec4 plane;
in vec3 start;
out float side;
void main() {
  vec4 place = model * vec4(start, 1.0);
  side = dot(plane, place);
  gl_Position = projection * (view * place);
}`;

  const PLAIN = HEAD + `
uniform vec4 tint;
in float side;
out vec4 pixel;
void main() {
  if (side < 0.0) discard;
  pixel = tint;
}`;

  class Refused extends Error {}

  // Reads the arrays of a message in order; refuses one that is too short.
  class Reader {
    constructor(buffer) {
      this.buffer = buffer;
      this.at = HEADER;
    }

    take(type, count) {
      const bytes = count * type.BYTES_PER_ELEMENT;
      if (this.at + bytes > this.buffer.byteLength) throw new Refused("the message is too short");
      const array = new type(this.buffer, this.at, count);
      this.at += (bytes + 3) & ~3;
      return array;
    }

    get left() {
      return this.buffer.byteLength - this.at;
    }

    end() {
      if (this.left !== 0) throw new Refused("the message is too long");
    }
  }

  function require(condition, reason) {
    if (!condition) throw new Refused(reason);
  }

  function largest(array) {
    let most = -1;
    for (let k = 0; k < array.length; k++) if (array[k] > most) most = array[k];
    return most;
  }

  function areFinite(array) {
    for (let k = 0; k < array.length; k++) if (!Number.isFinite(array[k])) return false;
    return true;
  }

  // The neighbours of each vertex in the order of its faces, as texels of four: fans one after
  // another, separated and padded by the vertex itself, where the cross products vanish.
  function fansOf(n, faces, twice) {
    const original = (v) => (v < n ? v : twice[v - n]);
    const starts = new Uint32Array(n + 1);
    for (let k = 0; k < faces.length; k++) starts[original(faces[k]) + 1]++;
    for (let v = 0; v < n; v++) starts[v + 1] += starts[v];
    const ends = starts.slice(0, n), from = new Uint32Array(faces.length);
    const to = new Uint32Array(faces.length);
    for (let f = 0; f < faces.length; f += 3) {
      for (let c = 0; c < 3; c++) {
        const drawn = faces[f + c], v = original(drawn), at = ends[v]++;
        const b = original(faces[f + ((c + 1) % 3)]), d = original(faces[f + ((c + 2) % 3)]);
        from[at] = drawn < n ? b : d; // a face at the second copy counts negative
        to[at] = drawn < n ? d : b;
      }
    }
    const fans = new Uint32Array(4 * (n + twice.length));
    let list = new Uint32Array(4 * (2 * n + faces.length)), used = 0;
    for (let v = 0; v < n; v++) {
      const first = starts[v], last = starts[v + 1];
      let left = last - first;
      const done = new Uint8Array(left);
      const begin = used;
      if (used + 4 * left + 4 > list.length) {
        const more = new Uint32Array(2 * list.length + 4 * left + 4);
        more.set(list);
        list = more;
      }
      while (left > 0) {
        let here = -1;
        for (let k = first; k < last && here < 0; k++) {
          if (done[k - first]) continue;
          let follows = false; // whether another face comes before this one
          for (let j = first; j < last; j++) follows ||= !done[j - first] && to[j] === from[k];
          if (!follows) here = k;
        }
        if (here < 0) here = first + done.indexOf(0); // a closed fan begins anywhere
        if (used > begin) list[used++] = v;
        list[used++] = from[here];
        while (here >= 0) {
          list[used++] = to[here];
          done[here - first] = 1;
          left--;
          const reached = to[here];
          here = -1;
          for (let k = first; k < last; k++) {
            if (!done[k - first] && from[k] === reached) {
              here = k;
              break;
            }
          }
        }
      }
      while (used % 4) list[used++] = v;
      fans.set([begin / 4, (used - begin) / 4, 0, 0], 4 * v);
    }
    for (let k = 0; k < twice.length; k++) {
      const v = twice[k];
      fans.set([fans[4 * v], fans[4 * v + 1], 1, 0], 4 * (n + k));
    }
    return { fans, neighbours: list.subarray(0, used) };
  }

  class SegdeformSurface {
    // Return a surface that draws in a canvas, or null where WebGL 2 cannot do it.
    static create(canvas, { antialias } = {}) {
      const options = { alpha: true, premultipliedAlpha: true, depth: true };
      const probe = document.createElement("canvas").getContext("webgl2");
      if (!probe) return null;
      const names = probe.getExtension("WEBGL_debug_renderer_info");
      const name = names ? probe.getParameter(names.UNMASKED_RENDERER_WEBGL) : "";
      const isSoftware = /swiftshader|llvmpipe|software|basic render/i.test(name);
      probe.getExtension("WEBGL_lose_context")?.loseContext();
      const gl = canvas.getContext("webgl2", { ...options, antialias: antialias ?? !isSoftware });
      if (!gl || !gl.getExtension("EXT_color_buffer_float")) return null;
      const surface = new SegdeformSurface(canvas, gl, isSoftware);
      return surface._isLost ? null : surface;
    }

    constructor(canvas, gl, isSoftware) {
      this.canvas = canvas;
      this.gl = gl;
      this.isSoftware = isSoftware;
      this.serial = null; // of the surface in use
      this.pose = null; // number of the pose that the next picture shows
      this.ondraw = null; // called after each picture with the number of its pose
      this.onlost = null; // called when the graphics memory was lost: the server must send all again
      this._look = null;
      this._request = 0;
      this._begin();
      canvas.addEventListener("webglcontextlost", (event) => {
        event.preventDefault();
        this.serial = null;
        this._isLost = true;
      });
      canvas.addEventListener("webglcontextrestored", () => {
        this._begin();
        if (!this._isLost) this.onlost?.();
      });
    }

    // Use a message (ArrayBuffer).  Return "" or, with nothing changed, why it was refused.
    receive(buffer) {
      try {
        require(!this._isLost, "the graphics memory was lost");
        require(buffer instanceof ArrayBuffer && buffer.byteLength >= HEADER, "no message");
        const head = new DataView(buffer);
        require(head.getUint32(0, true) === MAGIC, "no message of this program");
        require(head.getUint16(4, true) === VERSION, "a message of another version");
        require(head.getUint32(8, true) === buffer.byteLength, "a message of another length");
        const kind = head.getUint16(6, true), serial = head.getUint32(12, true);
        const reader = new Reader(buffer);
        const read = {
          [SURFACE]: this._readSurface, [CAGES]: this._readCages, [OFFSETS]: this._readOffsets,
          [COLOURS]: this._readColours, [LOOK]: this._readLook, [MARKS]: this._readMarks,
        }[kind];
        require(read, "a message of unknown kind");
        const isFree = kind === SURFACE || kind === LOOK || kind === MARKS;
        require(isFree || serial === this.serial, "a message for another surface");
        read.call(this, reader, serial);
        this.request();
        return "";
      } catch (fault) {
        if (fault instanceof Refused || fault instanceof RangeError) return fault.message;
        return `the message could not be used: ${fault.message}`;
      }
    }

    // Draw at the next opportunity.
    request() {
      if (!this._request) {
        this._request = requestAnimationFrame(() => {
          this._request = 0;
          this.draw();
        });
      }
    }

    // Draw nothing from now on, until another surface arrives.
    clear() {
      this.serial = this.pose = null;
      this._marks = [];
      this.request();
    }

    // Draw now.
    draw() {
      const gl = this.gl;
      if (this._isLost) return;
      gl.bindFramebuffer(gl.FRAMEBUFFER, null);
      gl.viewport(0, 0, this.canvas.width, this.canvas.height);
      gl.clearColor(0, 0, 0, 0);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      if (this.serial === null || !this._look) return;
      if (this._isMoved) this._pose();
      gl.bindFramebuffer(gl.FRAMEBUFFER, null);
      gl.viewport(0, 0, this.canvas.width, this.canvas.height);
      const projection = this._projection();
      this._drawBody(projection);
      for (const mark of this._marks) if (!mark.isAbove) this._drawMark(mark, projection);
      gl.clear(gl.DEPTH_BUFFER_BIT);
      for (const mark of this._marks) if (mark.isAbove) this._drawMark(mark, projection);
      this.ondraw?.(this.pose);
    }

    // Reading messages.

    _readSurface(reader, serial) {
      const gl = this.gl;
      const [n, t, f, m, nSets, nColumns, nWeights] = reader.take(Uint32Array, 7);
      require(n > 0 && f > 0 && n + t < 1 << 22 && f < 1 << 23 && m <= 1 << 16,
        "a surface of impossible size");
      require(!this.isSoftware || n <= MOST_IN_SOFTWARE,
        "this surface is too large without a graphics processor");
      const rest = reader.take(Float32Array, 3 * n), steps = reader.take(Float32Array, n);
      const sets = reader.take(Uint16Array, n), lengths = reader.take(Uint32Array, nSets);
      const columns = reader.take(Uint16Array, nColumns);
      const weights = reader.take(Int16Array, nWeights);
      const faces = reader.take(Uint32Array, 3 * f);
      const twice = reader.take(Uint32Array, t);
      reader.end();
      require(areFinite(rest) && areFinite(steps), "a surface with coordinates that are no numbers");
      require(largest(faces) < n + t, "a face without its vertices");
      require(t === 0 || largest(twice) < n, "a second copy of no vertex");
      require(largest(sets) < nSets, "a vertex in no set");
      require(nColumns === 0 || largest(columns) < m, "a weight of no cage vertex");
      const firsts = [];
      let groups = 0, columnsUsed = 0;
      for (const length of lengths) {
        require(length % GROUP === 0, "a set whose weights are not in groups");
        firsts.push(groups);
        groups += length / GROUP;
        columnsUsed += length;
      }
      require(columnsUsed === nColumns, "sets of impossible size");
      // A texel for every vertex, those drawn twice included.
      const drawn = n + t, height = Math.ceil(drawn / ROW);
      const places = new Float32Array(4 * ROW * height), rows = new Uint32Array(4 * ROW * height);
      let at = 0;
      for (let v = 0; v < n; v++) {
        const set = sets[v], count = lengths[set] / GROUP;
        places.set([rest[3 * v], rest[3 * v + 1], rest[3 * v + 2], steps[v]], 4 * v);
        rows.set([at, firsts[set], count, 0], 4 * v);
        at += count;
      }
      require(at * GROUP === nWeights, "rows of impossible size");
      for (let k = 0; k < t; k++) {
        places.copyWithin(4 * (n + k), 4 * twice[k], 4 * twice[k] + 4);
        rows.copyWithin(4 * (n + k), 4 * twice[k], 4 * twice[k] + 4);
      }
      const most = gl.getParameter(gl.MAX_TEXTURE_SIZE);
      const { fans, neighbours } = fansOf(n, faces, twice);
      const tall = [height, at / ROW, neighbours.length / 4 / ROW, 3 * (groups / ROW + 1)];
      require(Math.max(...tall) < most, "this surface is too large for the graphics memory");
      this._free();
      this.serial = serial;
      this._n = n;
      this._twice = twice.slice();
      this._m = m;
      this._columns = columns.slice();
      this._rest = this._texture(gl.RGBA32F, places, height);
      this._rows = this._texture(gl.RGBA32UI, rows, height);
      this._weights = this._texture(gl.RGBA16I, weights);
      this._fans = this._texture(gl.RGBA32UI, fans);
      this._neighbours = this._texture(gl.RGBA32UI, neighbours);
      this._moves = new Float32Array(4 * ROW * 3 * Math.max(1, Math.ceil(groups / ROW)));
      this._cages = this._texture(gl.RGBA32F, this._moves);
      this._offsets = this._texture(gl.RGBA16I, new Int16Array(4));
      this._offsetStep = 0;
      this._positions = this._texture(gl.RGBA32F, null, height);
      this._normals = this._texture(gl.RGBA32F, null, height);
      this._height = height;
      gl.bindVertexArray(this._body);
      this._faces = gl.createBuffer();
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this._faces);
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, faces, gl.STATIC_DRAW);
      this._corners = faces.length;
      [this._places, this._directions] = [POSITION, DIRECTION].map((attribute) => {
        const buffer = gl.createBuffer();
        gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
        gl.bufferData(gl.ARRAY_BUFFER, 16 * ROW * height, gl.DYNAMIC_COPY);
        gl.enableVertexAttribArray(attribute);
        gl.vertexAttribPointer(attribute, 4, gl.FLOAT, false, 0, 0);
        return buffer;
      });
      this._colours = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, this._colours);
      gl.vertexAttribPointer(COLOUR, 4, gl.UNSIGNED_BYTE, true, 0, 0);
      this._buffers = [this._faces, this._places, this._directions, this._colours];
      gl.bindVertexArray(null);
      this._hasColours = false;
      this.pose = null;
      this._isMoved = true;
    }

    _readCages(reader) {
      const [number] = reader.take(Uint32Array, 1);
      const moves = reader.take(Float32Array, 3 * this._m);
      reader.end();
      require(areFinite(moves), "a pose that is no numbers");
      const columns = this._columns, texels = this._moves;
      for (let k = 0; k < columns.length; k++) {
        const group = k >> 2;
        const at = 4 * ((group & (ROW - 1)) + 3 * ROW * (group >> ROW_BITS)) + (k & 3);
        for (let d = 0; d < 3; d++) texels[at + 4 * ROW * d] = moves[3 * columns[k] + d];
      }
      const gl = this.gl, wide = Math.min(columns.length >> 2, ROW);
      gl.bindTexture(gl.TEXTURE_2D, this._cages);
      gl.pixelStorei(gl.UNPACK_ROW_LENGTH, ROW);
      gl.texSubImage2D(
        gl.TEXTURE_2D, 0, 0, 0, wide, texels.length / (4 * ROW), gl.RGBA, gl.FLOAT, texels);
      gl.pixelStorei(gl.UNPACK_ROW_LENGTH, 0);
      this.pose = number;
      this._isMoved = true;
    }

    _readOffsets(reader) {
      const n = this._n, [step] = reader.take(Float32Array, 1);
      const isNone = reader.left === 0;
      const given = reader.take(Int16Array, isNone ? 0 : 3 * n);
      reader.end();
      require(Number.isFinite(step) && step >= 0, "offsets that are no numbers");
      const texels = new Int16Array(isNone ? 4 : 4 * ROW * this._height);
      for (let v = 0; v < given.length / 3; v++) {
        texels.set([given[3 * v], given[3 * v + 1], given[3 * v + 2], 0], 4 * v);
      }
      this._twice.forEach((v, k) => {
        if (!isNone) texels.copyWithin(4 * (n + k), 4 * v, 4 * v + 4);
      });
      this.gl.deleteTexture(this._offsets);
      this._offsets = this._texture(this.gl.RGBA16I, texels);
      this._offsetStep = isNone ? 0 : step;
      this._isMoved = true;
    }

    _readColours(reader) {
      const n = this._n, isNone = reader.left === 0;
      const given = reader.take(Uint8Array, isNone ? 0 : 4 * n);
      reader.end();
      const gl = this.gl;
      this._hasColours = !isNone;
      if (isNone) return;
      const all = new Uint8Array(4 * (n + this._twice.length));
      all.set(given);
      this._twice.forEach((v, k) => all.copyWithin(4 * (n + k), 4 * v, 4 * v + 4));
      gl.bindBuffer(gl.ARRAY_BUFFER, this._colours);
      gl.bufferData(gl.ARRAY_BUFFER, all, gl.DYNAMIC_DRAW);
    }

    _readLook(reader) {
      const numbers = reader.take(Float32Array, LOOK_NUMBERS);
      const lights = reader.take(Float32Array, reader.left / 4);
      reader.end();
      require(lights.length % 6 === 0 && lights.length <= 6 * LIGHTS, "lights of impossible number");
      require(areFinite(numbers) && areFinite(lights), "a look that is no numbers");
      const directions = new Float32Array(3 * LIGHTS), strengths = new Float32Array(3 * LIGHTS);
      for (let k = 0; k < lights.length / 6; k++) {
        directions.set(lights.subarray(6 * k, 6 * k + 3), 3 * k);
        strengths.set(scaled(lights.subarray(6 * k + 3, 6 * k + 6), numbers[36]), 3 * k);
      }
      this._look = {
        view: numbers.slice(0, 16), projection: numbers.slice(16, 32),
        colour: [...numbers.slice(32, 35)], ambient: numbers[35],
        count: lights.length / 6, directions, strengths,
      };
    }

    _readMarks(reader) {
      const marks = [], all = new Map(); // by number; known ones are kept
      while (reader.left > 0) {
        const numbers = reader.take(Float32Array, MARK_NUMBERS);
        const [shape, isAbove, r, g, b, a, size, count, number, showsBacks] = numbers;
        require(areFinite(numbers) && [1, 2, 3].includes(shape), "a mark of unknown shape");
        require(Number.isInteger(count) && count >= 0 && count % shape === 0, "a mark cut short");
        const points = all.get(number) ?? this._points.get(number)
          ?? { numbers: reader.take(Float32Array, 3 * count).slice(), count, buffer: null };
        require(points.count === count, "a mark with the points of another");
        all.set(number, points);
        marks.push({
          shape, isAbove: isAbove > 0, tint: [r * a, g * a, b * a, a], size, points,
          showsBacks: showsBacks > 0, model: numbers.slice(10, 26), plane: numbers.slice(26, 30),
        });
      }
      for (const [number, { buffer }] of this._points) {
        if (!all.has(number)) this.gl.deleteBuffer(buffer);
      }
      this._points = all;
      this._marks = marks;
    }

    // Drawing.

    // Create what every surface needs.  This fails with a driver that compiles none of it, and when
    // the browser loses the graphics memory meanwhile, which `isContextLost` says only later.
    _begin() {
      try {
        this._create();
        this._isLost = false;
      } catch (fault) {
        this._isLost = true;
        console.warn(`The page cannot draw the surface: ${fault.message}`);
      }
    }

    _create() {
      const gl = this.gl;
      gl.getExtension("EXT_color_buffer_float"); // positions are drawn into a texture
      this._posed = this._program(WHOLE, POSITIONS);
      this._oriented = this._program(WHOLE, NORMALS);
      this._drawn = [...Array(LIGHTS + 1).keys()].map(() => null); // by the number of lights
      this._marked = this._program(MARK, FLAT);
      this._painted = this._program(PAINTED, PLAIN);
      this._body = gl.createVertexArray();
      this._none = gl.createVertexArray();
      this._lines = gl.createVertexArray();
      this._marks = [];
      this._points = new Map(); // of marks, by number
      this._target = gl.createFramebuffer();
      this._textures = this._buffers = [];
    }

    _free() {
      const gl = this.gl;
      for (const texture of this._textures) gl.deleteTexture(texture);
      for (const buffer of this._buffers) gl.deleteBuffer(buffer);
      this._textures = this._buffers = [];
    }

    _program(vertex, fragment) {
      const gl = this.gl, program = gl.createProgram();
      for (const [type, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
        const shader = gl.createShader(type);
        gl.shaderSource(shader, source);
        gl.compileShader(shader);
        gl.attachShader(program, shader);
      }
      gl.bindAttribLocation(program, POSITION, "position");
      gl.bindAttribLocation(program, DIRECTION, "direction");
      gl.bindAttribLocation(program, COLOUR, "colour");
      gl.linkProgram(program);
      if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
        const shaders = gl.getAttachedShaders(program).map((each) => gl.getShaderInfoLog(each));
        throw new Error(`${gl.getProgramInfoLog(program)} ${shaders.join(" ")}`);
      }
      const uniforms = {}, attributes = {};
      for (let k = 0; k < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); k++) {
        const name = gl.getActiveUniform(program, k).name.replace("[0]", "");
        uniforms[name] = gl.getUniformLocation(program, name);
      }
      for (let k = 0; k < gl.getProgramParameter(program, gl.ACTIVE_ATTRIBUTES); k++) {
        const name = gl.getActiveAttrib(program, k).name;
        attributes[name] = gl.getAttribLocation(program, name);
      }
      return { program, uniforms, attributes };
    }

    // Return a texture of ROW texels in a row with the numbers of an array, padded to whole rows.
    _texture(format, array, height = Math.max(1, Math.ceil(array.length / 4 / ROW))) {
      const gl = this.gl, texture = gl.createTexture();
      const [layout, type] = {
        [gl.RGBA32F]: [gl.RGBA, gl.FLOAT],
        [gl.RGBA32UI]: [gl.RGBA_INTEGER, gl.UNSIGNED_INT],
        [gl.RGBA16I]: [gl.RGBA_INTEGER, gl.SHORT],
      }[format];
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.texStorage2D(gl.TEXTURE_2D, 1, format, ROW, height);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
      if (array) {
        const whole = new array.constructor(4 * ROW * height);
        whole.set(array);
        gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, ROW, height, layout, type, whole);
      }
      this._textures.push(texture);
      return texture;
    }

    _use({ program, uniforms }, textures) {
      const gl = this.gl;
      gl.useProgram(program);
      Object.entries(textures).forEach(([name, texture], unit) => {
        gl.activeTexture(gl.TEXTURE0 + unit);
        gl.bindTexture(gl.TEXTURE_2D, texture);
        gl.uniform1i(uniforms[name], unit);
      });
      gl.activeTexture(gl.TEXTURE0);
      return uniforms;
    }

    // Compute positions and normals.
    _pose() {
      const gl = this.gl;
      gl.disable(gl.DEPTH_TEST);
      gl.disable(gl.BLEND);
      gl.bindVertexArray(this._none);
      gl.viewport(0, 0, ROW, this._height);
      gl.bindFramebuffer(gl.FRAMEBUFFER, this._target);
      const into = (texture, buffer) => {
        gl.framebufferTexture2D(
          gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
        gl.drawArrays(gl.TRIANGLES, 0, 3);
        gl.bindBuffer(gl.PIXEL_PACK_BUFFER, buffer);
        gl.readPixels(0, 0, ROW, this._height, gl.RGBA, gl.FLOAT, 0);
        gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
      };
      const uniforms = this._use(this._posed, {
        rest: this._rest, rows: this._rows, weights: this._weights, cages: this._cages,
        offsets: this._offsets,
      });
      gl.uniform1f(uniforms.offset_step, this._offsetStep);
      into(this._positions, this._places);
      this._use(this._oriented, {
        positions: this._positions, fans: this._fans, neighbours: this._neighbours,
      });
      into(this._normals, this._directions);
      this._isMoved = false;
    }

    // Return the server's projection with planes in front of and behind any pose of the surface.
    _projection() {
      const { view, projection } = this._look, result = projection.slice();
      const size = Math.hypot(view[2], view[6], view[10]), reach = 2.0 * size, middle = -view[14];
      if (projection[11] === 0) { // orthographic
        result[10] = -1 / reach;
        result[14] = -middle / reach;
        return result;
      }
      const far = Math.max(middle + reach, 1e-3 * size);
      const near = Math.max(middle - reach, 2e-3 * far);
      result[10] = -(far + near) / (far - near);
      result[14] = (-2 * far * near) / (far - near);
      return result;
    }

    _drawBody(projection) {
      const gl = this.gl, look = this._look;
      this._drawn[look.count] ??= this._program(BODY, lit(look.count));
      const uniforms = this._use(this._drawn[look.count], {});
      gl.uniformMatrix4fv(uniforms.view, false, look.view);
      gl.uniformMatrix4fv(uniforms.projection, false, projection);
      gl.uniform3fv(uniforms.directions, look.directions);
      gl.uniform3fv(uniforms.strengths, look.strengths);
      gl.uniform1f(uniforms.ambient, look.ambient);
      gl.enable(gl.DEPTH_TEST);
      gl.disable(gl.BLEND);
      gl.bindVertexArray(this._body);
      if (this._hasColours) {
        gl.enableVertexAttribArray(COLOUR);
      } else {
        gl.disableVertexAttribArray(COLOUR);
        gl.vertexAttrib4f(COLOUR, ...look.colour, 1);
      }
      gl.drawElements(gl.TRIANGLES, this._corners, gl.UNSIGNED_INT, 0);
    }

    _drawMark(mark, projection) {
      const gl = this.gl, program = mark.shape === 3 ? this._painted : this._marked;
      const { points } = mark;
      const uniforms = this._use(program, {}), { start, end } = program.attributes;
      gl.uniformMatrix4fv(uniforms.view, false, this._look.view);
      gl.uniformMatrix4fv(uniforms.projection, false, projection);
      gl.uniformMatrix4fv(uniforms.model, false, mark.model);
      gl.uniform4fv(uniforms.plane, mark.plane);
      gl.uniform4fv(uniforms.tint, mark.tint);
      gl.enable(gl.DEPTH_TEST);
      gl.enable(gl.BLEND);
      gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
      gl.bindVertexArray(this._lines);
      if (!points.buffer) {
        points.buffer = gl.createBuffer();
        gl.bindBuffer(gl.ARRAY_BUFFER, points.buffer);
        gl.bufferData(gl.ARRAY_BUFFER, points.numbers, gl.STATIC_DRAW);
      }
      gl.bindBuffer(gl.ARRAY_BUFFER, points.buffer);
      const each = mark.shape === 3 ? 0 : 1, stride = each ? 12 * mark.shape : 12;
      const ends = each ? [[start, 0], [end, 12 * (mark.shape - 1)]] : [[start, 0]];
      for (const [attribute, offset] of ends) {
        gl.enableVertexAttribArray(attribute);
        gl.vertexAttribPointer(attribute, 3, gl.FLOAT, false, stride, offset);
        gl.vertexAttribDivisor(attribute, each);
      }
      if (each) {
        gl.uniform2f(uniforms.pixels, this.canvas.width / 2, this.canvas.height / 2);
        gl.uniform1f(uniforms.size, mark.size / 2 + 0.5);
        gl.uniform1f(uniforms.lift, 2e-3);
        gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, points.count / mark.shape);
      } else {
        if (mark.showsBacks) gl.enable(gl.CULL_FACE);
        gl.cullFace(gl.FRONT);
        gl.drawArrays(gl.TRIANGLES, 0, points.count);
        gl.cullFace(gl.BACK);
        gl.disable(gl.CULL_FACE);
      }
      for (const [attribute] of ends) {
        gl.disableVertexAttribArray(attribute);
        gl.vertexAttribDivisor(attribute, 0);
      }
    }
  }

  const scaled = (a, s) => [a[0] * s, a[1] * s, a[2] * s];

  globalThis.SegdeformSurface = SegdeformSurface;
})();

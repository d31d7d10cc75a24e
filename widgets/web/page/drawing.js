// The surface drawn by the page during a drag, in a layer over the server's picture.
//
// The layer shows, from below: the server's last picture, with the background where the surface was;
// the surface in its current pose; texts that have appeared since.  When the server sends a picture
// again, which it does once the view rests, the layer fades.
//
// Without a graphics processor, putting the layer together takes as long as drawing the surface.
// The lowest canvas is therefore opaque, which hides all below it from the browser's compositor, and
// the canvas of the texts is no larger than they are.
import './surface.js';

const CUT = 3; // pixels around the surface in the server's picture that are cut out with it
const SEVERAL = [[0, 0], [-CUT, -CUT], [CUT, -CUT], [-CUT, CUT], [CUT, CUT]];
const COLOUR = /rgba?\([^)]*\)/g;

function resize(canvas, width, height) {
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
}

export default class Drawing {
  // *layer* has three canvases: for the picture, the surface and the texts.
  constructor(layer, picture, call) {
    const [backdrop, body, words] = layer.querySelectorAll('canvas');
    Object.assign(this, { layer, picture, backdrop, body, words, call, number: 0, written: '' });
    this.below = backdrop.getContext('2d', { alpha: false });
    this.surface = globalThis.SegdeformSurface.create(body);
    if (!this.surface) return;
    this.surface.ondraw = () => this.drawn();
    this.surface.onlost = () => this.want(this.isWanted); // the memory is there again
    body.addEventListener('webglcontextlost', () => this.leave());
  }

  get isPossible() { return Boolean(this.surface); }

  // Draw from now on, or let the server do it.
  want(isWanted) {
    this.isWanted = isWanted;
    if (this.surface) this.call('draws', isWanted);
    if (!isWanted) this.hide();
  }

  // Let the server draw, because this page cannot.
  leave() {
    this.hide();
    this.call('draws', false);
  }

  // Fetch a surface piece by piece, so that pictures can come in between.
  async fetch({ version, size }) {
    const whole = new Uint8Array(size);
    for (let at = 0; at < size;) {
      const piece = await this.call('surface', version, at);
      if (!piece || !piece.length) return; // there is a newer one
      whole.set(piece, at);
      at += piece.length;
    }
    const messages = [], numbers = new DataView(whole.buffer);
    for (let at = 0; at < size; at += numbers.getUint32(at + 8, true)) {
      messages.push(whole.subarray(at, at + numbers.getUint32(at + 8, true)));
    }
    if (!this.receive(messages)) return;
    this.layer.dataset.surface = version;
    this.call('holds', version);
  }

  // Draw an update; the first one of a drag shows what the picture shows.
  show({ number, messages, labels, width, height, is_first: isFirst, time }) {
    if (!this.surface || !this.receive(messages)) return;
    resize(this.backdrop, width, height);
    resize(this.body, width, height);
    this.number = number;
    this.time = time;
    this.write(labels, width, height);
    if (isFirst) {
      this.surface.draw();
      this.cut();
    } else {
      this.layer.classList.add('on');
      this.surface.request();
      if (document.hidden) this.drawn();
    }
  }

  hide() {
    this.layer.classList.remove('on');
    this.number = 0;
  }

  receive(messages) {
    const isUsed = messages.every((each) => !this.surface.receive(each.slice().buffer));
    if (!isUsed) this.leave();
    return isUsed;
  }

  drawn() {
    if (!this.number) return;
    this.layer.dataset.time = this.time;
    this.layer.dataset.number = this.number;
    this.call('shown', this.number);
    this.number = 0;
  }

  // Copy the picture without the surface, which must have been drawn as the picture shows it.
  cut() {
    const { width, height } = this.backdrop;
    const rest = Object.assign(document.createElement('canvas'), { width, height });
    const context = rest.getContext('2d');
    context.drawImage(this.picture, 0, 0, width, height);
    context.globalCompositeOperation = 'destination-out';
    for (const [x, y] of SEVERAL) context.drawImage(this.body, x, y, width, height);
    const colours = getComputedStyle(this.layer).backgroundImage.match(COLOUR) ?? ['white'];
    const gradient = this.below.createLinearGradient(0, 0, 0, height);
    colours.forEach((each, k) => gradient.addColorStop(k / Math.max(1, colours.length - 1), each));
    this.below.fillStyle = gradient;
    this.below.fillRect(0, 0, width, height);
    this.below.drawImage(rest, 0, 0);
  }

  // Write texts and rectangles, given in pixels of a view of this size.
  write(labels, width, height) {
    const written = JSON.stringify([labels, width, height]);
    if (written === this.written) return;
    this.written = written;
    const context = this.words.getContext('2d'), { style } = this.words;
    const font = (size) => `bold ${size}px "DejaVu Sans", system-ui, sans-serif`;
    let [left, top, right, bottom] = [Infinity, Infinity, -Infinity, -Infinity];
    for (const { text, place, box, size } of labels) {
      context.font = font(size);
      const [x, y, w, h] = box
        ?? [place[0], place[1] - size, context.measureText(text).width, 2 * size];
      left = Math.max(0, Math.min(left, Math.floor(x)));
      top = Math.max(0, Math.min(top, Math.floor(y)));
      right = Math.min(width, Math.max(right, Math.ceil(x + w)));
      bottom = Math.min(height, Math.max(bottom, Math.ceil(y + h)));
    }
    const wide = Math.max(1, right - left), high = Math.max(1, bottom - top);
    Object.assign(this.words, { width: wide, height: high }); // which clears it
    style.display = right > left && bottom > top ? '' : 'none';
    const parts = { left: left / width, top: top / height, width: wide / width, height: high / height };
    for (const [name, part] of Object.entries(parts)) style[name] = `${100 * part}%`;
    context.textBaseline = 'middle';
    context.translate(-left, -top);
    for (const { text, place, box, size, colour } of labels) {
      context.fillStyle = colour;
      context.font = font(size);
      if (box) context.fillRect(...box);
      else context.fillText(text, ...place);
    }
  }
}

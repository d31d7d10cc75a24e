// The surface drawn by the page during a drag, in a layer over the server's picture.
//
// The layer shows, from below: the background; the server's last picture, cut out where the surface
// was; the surface in its current pose; texts that have appeared since.  When the server sends a
// picture again, which it does once the view rests, the layer fades.
import './surface.js';

const CUT = 3; // pixels around the surface in the server's picture that are cut out with it
const SEVERAL = [[0, 0], [-CUT, -CUT], [CUT, -CUT], [-CUT, CUT], [CUT, CUT]];

export default class Drawing {
  // *layer* has three canvases: for the picture, the surface and the texts.
  constructor(layer, picture, call) {
    const [backdrop, body, words] = layer.querySelectorAll('canvas');
    Object.assign(this, { layer, picture, backdrop, body, words, call, number: 0 });
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
    for (const canvas of [this.backdrop, this.body, this.words]) {
      if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    }
    this.number = number;
    this.time = time;
    this.write(labels);
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
    const { width, height } = this.backdrop, context = this.backdrop.getContext('2d');
    context.globalCompositeOperation = 'copy';
    context.drawImage(this.picture, 0, 0, width, height);
    context.globalCompositeOperation = 'destination-out';
    for (const [x, y] of SEVERAL) context.drawImage(this.body, x, y);
  }

  write(labels) {
    const context = this.words.getContext('2d');
    context.clearRect(0, 0, this.words.width, this.words.height);
    context.textBaseline = 'middle';
    for (const { text, place, box, size, colour } of labels) {
      context.fillStyle = colour;
      if (box) context.fillRect(...box);
      else {
        context.font = `bold ${size}px "DejaVu Sans", system-ui, sans-serif`;
        context.fillText(text, ...place);
      }
    }
  }
}

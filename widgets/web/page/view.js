// The view of the editor in a page: pictures from the server, input to it.
//
// Positions are fractions of the view.  Moves of one animation frame become one, and no more than
// AHEAD messages are on their way at once, so a slow network gets fewer moves, not later ones.
// One finger is the left button; two fingers turn (Alt and the left button) and pinch (the wheel);
// three fingers pan (the middle button).  During a drag the page may draw itself; see `Drawing`.
import Drawing from './drawing.js';
import receiveBuffers from './socket.js';

const AHEAD = 3; // messages without an answer
const WHEEL = 100, PINCHED_WHEEL = 12; // pixels of one click of the wheel
const PINCH = Math.log(1.2); // one click of the wheel zooms by 1.2
const TAP = { distance: 8, time: 150 }; // until when a second finger may still come
const OUTSIDE = { clientX: -99, clientY: -99 };
const BUTTONS = ['Left', 'Middle', 'Right'];
const LEFT_TO_BROWSER = new Set(['F5', 'F11', 'F12']);
const WITH_CONTROL = new Set(['z', 'y', 'a', 'i', '+', '-']);

class Outbox {
  constructor(call) {
    this.call = call;
    this.waiting = [];
    this.away = 0;
    this.isScheduled = false;
  }

  put(event) {
    const last = this.waiting[this.waiting.length - 1];
    if (event.name === 'MouseMove' && last && last.name === 'MouseMove') this.waiting.pop();
    this.waiting.push(event);
    if (event.name !== 'MouseMove') this.flush();
    else if (!this.isScheduled) {
      this.isScheduled = true;
      requestAnimationFrame(() => { this.isScheduled = false; this.flush(); });
    }
  }

  flush() {
    if (!this.waiting.length || this.away >= AHEAD) return;
    const events = this.waiting;
    this.waiting = [];
    this.away += 1;
    const back = () => { this.away -= 1; this.flush(); };
    this.call(events).then(back, back);
  }
}

// Fingers as a mouse: nothing is pressed before it is clear how many fingers there are.
class Fingers {
  constructor(view) {
    this.view = view;
    this.all = new Map();
    this.kind = '';
    this.timer = 0;
  }

  down(event) {
    this.all.set(event.pointerId, event);
    if (this.kind && this.kind !== 'wait') return; // further fingers do not change a drag
    this.kind = 'wait';
    clearTimeout(this.timer);
    if (this.all.size > 2) this.begin();
    else this.timer = setTimeout(() => this.begin(), TAP.time);
  }

  begin() {
    clearTimeout(this.timer);
    this.kind = ['', 'pull', 'turn', 'pan'][Math.min(this.all.size, 3)];
    if (!this.kind) return;
    const start = this.start || this.centre();
    this.spread = this.distance();
    this.press(start, 'Press');
  }

  press(place, what) {
    const button = this.kind === 'pan' ? 'Middle' : 'Left';
    const flags = { alt: this.kind === 'turn', shift: this.kind === 'pull' && this.view.pins };
    this.view.send('MouseMove', place, flags);
    this.view.send(`${button}Button${what}`, place, flags);
  }

  move(event) {
    const before = this.all.get(event.pointerId);
    if (!before) return;
    if (this.kind === 'wait') {
      const far = Math.hypot(event.clientX - before.clientX, event.clientY - before.clientY);
      if (far < TAP.distance) return;
      this.start = this.centre();
      this.begin();
    }
    this.all.set(event.pointerId, event);
    this.view.send('MouseMove', this.centre(), { alt: this.kind === 'turn' });
    if (this.kind === 'turn' && this.all.size === 2) {
      const clicks = Math.trunc(Math.log(this.distance() / this.spread) / PINCH);
      if (clicks) {
        this.spread *= Math.exp(clicks * PINCH);
        this.view.wheel(clicks, this.centre(), {});
      }
    }
  }

  up(event) {
    if (!this.all.has(event.pointerId)) return;
    if (this.kind === 'wait') this.begin(); // a tap
    const place = this.centre();
    this.all.delete(event.pointerId);
    if (this.kind !== 'over') this.press(place, 'Release');
    this.kind = this.all.size ? 'over' : '';
    this.start = null;
    if (!this.kind) this.view.send('MouseMove', OUTSIDE, {}); // nothing hovers
  }

  centre() {
    const all = [...this.all.values()];
    const mean = (name) => all.reduce((sum, each) => sum + each[name], 0) / all.length;
    return { clientX: mean('clientX'), clientY: mean('clientY') };
  }

  distance() {
    const [a, b] = [...this.all.values()];
    return b ? Math.max(1, Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY)) : 1;
  }
}

const isTyping = (event) => event.target.closest
  && event.target.closest('input, textarea, select, [contenteditable], [role=dialog]');
const isOnButton = (event) => event.target.closest && event.target.closest('button, a, [role=menu]');

const View = {
  props: { pins: Boolean, draws: Boolean, topic: { default: 'segdeform.picture' } },
  emits: ['download', 'open', 'drawable'],
  template: `<div class="sd-canvas" ref="area"
      @pointerdown="down" @pointermove="move" @pointerup="up" @pointercancel="up"
      @pointerleave="leave" @wheel.prevent="turn" @contextmenu.prevent
    ><canvas ref="canvas" role="img" aria-label="The surface"></canvas>
    <div class="sd-live" ref="live" aria-hidden="true">
      <canvas></canvas><canvas></canvas><canvas></canvas></div></div>`,
  inject: ['trame'],
  watch: { draws(draws) { this.drawing.want(draws); } },

  mounted() {
    const connection = this.trame.client.getConnection(), session = connection.getSession();
    receiveBuffers(connection);
    this.call = (method, ...args) => session.call(`segdeform.${method}`, args);
    this.outbox = new Outbox((events) => this.call('input', events));
    this.fingers = new Fingers(this);
    this.keys = new Map();
    this.rolled = 0;
    this.drawing = new Drawing(this.$refs.live, this.$refs.canvas, this.call);
    this.$emit('drawable', this.drawing.isPossible);
    this.drawing.want(this.draws);
    this.shown = Promise.resolve();
    this.subscription = session.subscribe(this.topic, ([event]) => {
      const next = () => this.show(event);
      this.shown = this.shown.then(next, next); // one after the other
    });
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(this.$refs.area);
    this.listeners = {
      keydown: (event) => this.key(event, true),
      keyup: (event) => this.key(event, false),
      blur: () => this.releaseKeys(),
    };
    for (const [name, call] of Object.entries(this.listeners)) window.addEventListener(name, call);
    this.resize();
  },

  beforeUnmount() {
    this.observer.disconnect();
    this.subscription.unsubscribe();
    for (const [name, call] of Object.entries(this.listeners)) window.removeEventListener(name, call);
  },

  methods: {
    // Pictures.
    async show(event) {
      const { number, width, height, content } = event, canvas = this.$refs.canvas;
      if (!canvas || number < (this.number || 0)) return;
      if (event.version) {
        this.drawing.fetch(event);
        return;
      }
      this.number = number;
      if (event.messages) {
        this.drawing.show(event);
        return;
      }
      const bitmap = await createImageBitmap(new Blob([content], { type: 'image/jpeg' }));
      if (canvas.width !== width || canvas.height !== height) {
        canvas.width = width;
        canvas.height = height;
      }
      canvas.getContext('bitmaprenderer').transferFromImageBitmap(bitmap);
      canvas.dataset.time = event.time;
      canvas.dataset.number = number;
      this.drawing.hide();
      this.call('shown', number);
    },

    resize() {
      clearTimeout(this.resizing);
      this.resizing = setTimeout(() => {
        const { width, height } = this.$refs.area.getBoundingClientRect();
        const ratio = window.devicePixelRatio || 1;
        if (width && height) this.call('size', width, height, ratio);
      }, 60);
    },

    // Input.
    send(name, place, flags, more) {
      const box = this.$refs.area.getBoundingClientRect();
      const x = (place.clientX - box.left) / box.width;
      const y = (place.clientY - box.top) / box.height;
      this.place = place;
      const time = place.timeStamp || performance.now();
      this.outbox.put({ name, x, y, time, ...flags, ...more });
    },

    flags(event) {
      return {
        shift: event.shiftKey,
        control: event.ctrlKey || event.metaKey,
        alt: event.altKey,
      };
    },

    down(event) {
      this.$refs.area.setPointerCapture(event.pointerId);
      if (document.activeElement) document.activeElement.blur();
      if (event.pointerType === 'touch') return this.fingers.down(event);
      const flags = this.flags(event);
      flags.shift = flags.shift || this.pins;
      this.send(`${BUTTONS[event.button] || 'Left'}ButtonPress`, event, flags);
    },

    move(event) {
      if (event.pointerType === 'touch') return this.fingers.move(event);
      this.send('MouseMove', event, this.flags(event));
    },

    up(event) {
      if (event.pointerType === 'touch') return this.fingers.up(event);
      if (event.button < 0) return; // cancelled
      this.send(`${BUTTONS[event.button] || 'Left'}ButtonRelease`, event, this.flags(event));
    },

    leave(event) {
      if (!event.buttons) this.send('MouseMove', OUTSIDE, {});
    },

    turn(event) {
      const scale = event.deltaMode === 1 ? 33 : event.deltaMode === 2 ? 300 : 1;
      const isPinch = event.ctrlKey && !this.keys.has('ControlLeft');
      const flags = this.flags(event);
      if (isPinch) flags.control = false;
      this.rolled -= scale * (event.deltaY || event.deltaX) / (isPinch ? PINCHED_WHEEL : WHEEL);
      const clicks = Math.trunc(this.rolled);
      this.rolled -= clicks;
      if (clicks) this.wheel(clicks, event, flags);
    },

    wheel(clicks, place, flags) {
      const name = `MouseWheel${clicks > 0 ? 'Forward' : 'Backward'}`;
      for (let k = Math.min(Math.abs(clicks), 5); k > 0; k -= 1) this.send(name, place, flags);
    },

    key(event, isDown) {
      if (!isDown) return this.releaseKey(event);
      if (isTyping(event) || event.isComposing || LEFT_TO_BROWSER.has(event.key)) return undefined;
      if (isOnButton(event) && ['Enter', ' ', 'Tab', 'Escape'].includes(event.key)) return undefined;
      const flags = this.flags(event), letter = event.key.toLowerCase();
      if (flags.control && !['Control', 'Meta', 'Shift', 'Alt'].includes(event.key)) {
        const own = { s: 'download', o: 'open' }[letter];
        if (own) this.$emit(own);
        if (own || WITH_CONTROL.has(letter) || event.code.startsWith('Numpad')) event.preventDefault();
        else return undefined;
        if (own) return undefined;
      } else event.preventDefault();
      this.keys.set(event.code, event.key);
      return this.sendKey('KeyPress', event.key, event.code, flags);
    },

    releaseKey(event) {
      const key = this.keys.get(event.code);
      this.keys.delete(event.code);
      if (key !== undefined) this.sendKey('KeyRelease', key, event.code, this.flags(event));
    },

    releaseKeys() {
      for (const [code, key] of this.keys) this.sendKey('KeyRelease', key, code, {});
      this.keys.clear();
    },

    sendKey(name, key, code, flags) {
      this.send(name, this.place || OUTSIDE, flags, { key, code });
    },
  },
};

export default View;

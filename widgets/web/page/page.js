// The page around the view: opening by upload, downloads, colours, drawer.
import controls from './panel.js';
import View from './view.js';

const COLOURS = 'segdeform colours';
const DRAWING = 'segdeform drawing', DRAWS = 'view.draw_in_browser';
const remembered = {
  get(name) { try { return localStorage.getItem(name); } catch { return null; } },
  set(name, value) { try { localStorage.setItem(name, value); } catch { /* private window */ } },
};
const address = (path) => new URL(path, document.baseURI);

const isTouch = window.matchMedia('(pointer: coarse)');
const LOST = 'The connection to the server was lost.';
const NAMES = { '?': 'question', Escape: 'escape' };

const Page = {
  props: { dark: Boolean },
  emits: ['dark'],
  inject: ['trame'],
  data: () => ({
    pins: false, panel: false, fault: '', sent: null, isOver: false, asked: null,
    isTouch: isTouch.matches, ended: '', hasHelp: false,
    previewed: null, draws: remembered.get(DRAWING) !== 'no', isDrawable: false,
  }),
  mounted() {
    // trame's page does not let anyone zoom.
    document.querySelector('meta[name=viewport]').content = 'width=device-width, initial-scale=1';
    const connection = this.trame.client.getConnection();
    connection.onConnectionClose((_, event) => this.end(event));
    connection.onConnectionError(() => this.end());
    window.addEventListener('keydown', this.key, true);
    const scheme = window.matchMedia('(prefers-color-scheme: dark)');
    const own = remembered.get(COLOURS);
    this.$emit('dark', own ? own === 'dark' : scheme.matches);
    this.follow = () => { if (!remembered.get(COLOURS)) this.$emit('dark', scheme.matches); };
    scheme.addEventListener('change', this.follow);
    this.scheme = scheme;
  },
  beforeUnmount() {
    this.scheme.removeEventListener('change', this.follow);
    window.removeEventListener('keydown', this.key, true);
  },
  methods: {
    press(name, value) {
      this.fault = '';
      if (name === DRAWS) {
        this.draws = value === true;
        remembered.set(DRAWING, this.draws ? 'yes' : 'no');
      } else if (name === 'help') this.hasHelp = true;
      else if (value?.file) this.upload(value.file, name);
      else if (value?.saves) this.download(value.saves, name);
      else this.trame.trigger('press', [name, value]);
    },
    preview(place) {
      if (place === this.previewed) return;
      this.previewed = place;
      this.press('history.preview', place);
    },
    jump(place) {
      this.preview(null);
      this.press('history', place);
    },
    end(event) {
      this.ended ||= event?.reason || LOST;
    },
    reload() { window.location.reload(); },
    // Keys of the page, before the view gets them: help, and the way into the toolbar.
    key(event) {
      const isPlain = !event.ctrlKey && !event.metaKey && !event.altKey;
      const isTyping = event.target.closest?.('input, textarea, select');
      const name = NAMES[event.key] || event.key.toLowerCase();
      const isHelp = isPlain && !isTyping && this.trame.state.get('help').keys.includes(name);
      if (name === 'escape' && this.trame.state.get('menu').length) this.press('menu', null);
      else if (this.hasHelp ? isHelp || name === 'escape' : isHelp) {
        this.hasHelp = !this.hasHelp;
      } else if (this.hasHelp || this.ended) {
        event.stopImmediatePropagation(); // nothing behind a dialog
        return;
      } else if (name === 'f6') {
        const inside = document.activeElement?.closest('.sd-bar, .sd-side');
        if (inside) document.activeElement.blur();
        else this.$el.querySelector('.sd-bar button:not(:disabled)').focus();
      } else if (name === 'tab' && !this.trame.state.get('uses_tab')) {
        event.stopImmediatePropagation(); // moves the focus, as in other pages
        return;
      } else return;
      event.preventDefault();
      event.stopImmediatePropagation();
    },
    // Return a field of the toolbar with what only this page knows.
    extended(field) {
      if (field.name !== 'view') return field;
      const own = {
        name: DRAWS, kind: 'toggle', label: 'Draw in the browser', value: this.draws,
        enabled: this.isDrawable,
        tip: this.isDrawable ? 'Draw the surface in this page during a drag'
          : 'This browser cannot draw the surface: it lacks WebGL 2',
      };
      return { ...field, items: [...field.items, null, own] };
    },
    setDrawable(isDrawable) { this.isDrawable = isDrawable; },
    toggleDark() {
      remembered.set(COLOURS, this.dark ? 'light' : 'dark');
      this.$emit('dark', !this.dark);
    },
    togglePins() { this.pins = !this.pins; },
    togglePanel() { this.panel = !this.panel; },
    settle(event) {
      const button = event.detail && event.target.closest('button');
      if (button) button.blur(); // the next key is for the editor
    },
    forget() { this.fault = ''; },

    // Files.
    choose() { this.$refs.file.click(); },
    chosen(event) {
      const [file] = event.target.files;
      event.target.value = '';
      this.offer(file);
    },
    over(event) {
      if (![...event.dataTransfer.types].includes('Files')) return;
      event.preventDefault();
      this.isOver = true;
    },
    drop(event) {
      this.isOver = false;
      const [file] = event.dataTransfer.files;
      if (!file) return;
      event.preventDefault();
      this.offer(file);
    },
    offer(file) {
      if (!file) return;
      const limit = this.trame.state.get('upload_limit');
      if (file.size > limit) {
        this.fault = `${file.name} is larger than ${Math.floor(limit / 1e6)} MB, the limit here.`;
      } else if (this.trame.state.get('document').modified) this.asked = file;
      else this.upload(file);
    },
    answer(yes) {
      const file = this.asked;
      this.asked = null;
      if (yes) this.upload(file);
    },
    // Open a file, or give it to a control of the panel.
    upload(file, field = '') {
      this.fault = '';
      this.sent = 0;
      const request = new XMLHttpRequest();
      const target = address('upload');
      target.searchParams.set('name', file.name);
      target.searchParams.set('field', field);
      request.open('POST', target);
      request.setRequestHeader('X-Segdeform', 'upload');
      request.upload.onprogress = (event) => { this.sent = event.loaded / event.total; };
      request.onloadend = () => {
        this.sent = null;
        if (request.status !== 200) {
          this.fault = request.responseText || `${file.name} could not be uploaded. Try it again.`;
        }
      };
      request.send(file);
    },
    async download(suffix, field = '') {
      this.fault = '';
      try {
        const from = address(`download/${suffix}`);
        from.searchParams.set('field', field);
        const answer = await fetch(from, { headers: { 'X-Segdeform': 'download' } });
        if (!answer.ok) throw new Error(await answer.text());
        const link = document.createElement('a');
        link.href = URL.createObjectURL(await answer.blob());
        const what = field && `-${field.split('_').pop()}`; // "target", of landmarks
        link.download = `${this.trame.state.get('document').stem}${what}.${suffix}`;
        link.click();
        setTimeout(() => URL.revokeObjectURL(link.href), 10000);
      } catch (error) {
        this.fault = error.message || 'The file could not be downloaded. Try it again.';
      }
    },
  },
  template: `
    <div class="sd" :class="{ dark }" @click="settle" @dragover="over" @dragleave.self="isOver = false" @drop="drop">
      <slot v-bind="{ ...$data, press, choose, download, togglePins, togglePanel, toggleDark,
        extended, setDrawable, forget, preview, jump }"></slot>
      <input ref="file" type="file" class="sd-file" aria-label="File to open" @change="chosen">
      <div v-if="isOver" class="sd-over" @dragover="over" @dragleave="isOver = false" @drop="drop">
        <span>Drop to open</span></div>
      <div v-if="asked" class="sd-ask" role="dialog" aria-modal="true">
        <div><h2>Unsaved changes will be lost.</h2>
          <p>Download the session first to keep them.</p>
          <button type="button" class="sd-button" @click="download('segdeform')">Download</button>
          <button type="button" class="sd-button" data-name="discard" @click="answer(true)">
            Open {{ asked.name }}</button>
          <button type="button" class="sd-button" @click="answer(false)">Cancel</button></div></div>
      <div v-if="hasHelp" class="sd-ask" @click.self="hasHelp = false">
        <div class="sd-help" role="dialog" aria-modal="true" aria-label="Keys">
          <button type="button" class="sd-close" title="Close (Esc)" aria-label="Close"
            @click="hasHelp = false"><i class="mdi mdi-close"></i></button>
          <section v-for="[heading, rows] in trame.state.get('help').sections" :key="heading">
            <h2>{{ heading }}</h2>
            <p v-for="[keys, what] in rows" :key="keys + what"><kbd>{{ keys }}</kbd>{{ what }}</p>
          </section></div></div>
      <div v-if="ended" class="sd-ask" role="alertdialog" aria-modal="true">
        <div><h2>{{ ended }}</h2>
          <p>Reload the page to continue where you were.</p>
          <button type="button" class="sd-button down" data-name="reload" @click="reload()">
            Reload</button></div></div>
    </div>`,
};

window.segdeform = {
  install(app) {
    const all = { 'sd-page': Page, 'sd-view': View, ...controls };
    for (const [name, component] of Object.entries(all)) app.component(name, component);
  },
};

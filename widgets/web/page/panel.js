// The controls of the panel, drawn from its models: a field, a table, a section, the toolbar.
// They know kinds of controls only; what a control does is known where its name goes, in `press`.
const ICONS = {
  open: 'mdi-folder-open-outline', save: 'mdi-download-outline', undo: 'mdi-undo',
  redo: 'mdi-redo', pull: 'mdi-gesture-swipe-up', regions: 'mdi-select-group',
  cages: 'mdi-cube-outline', handles: 'mdi-brush-outline', deform: 'mdi-axis-arrow',
  keep_part: 'mdi-lock-outline',
  compare: 'mdi-compare', view: 'mdi-eye-outline', help: 'mdi-keyboard-outline',
  brush: 'mdi-brush', lasso: 'mdi-lasso', rectangle: 'mdi-selection',
  connected_part: 'mdi-link-variant', whole_region: 'mdi-select-all', region: 'mdi-select-all',
  component: 'mdi-link-variant', pin: 'mdi-pin-outline', finish: 'mdi-check-all',
  fit_cages: 'mdi-cube-scan', segment: 'mdi-auto-fix',
};
const PERIOD = 60; // milliseconds between two values of a slider that is dragged

const Field = {
  props: { field: Object },
  emits: ['press'],
  data: () => ({ held: null, sentAt: 0 }),
  computed: {
    icon() { return ICONS[this.field.icon] || ICONS[this.field.action] || ''; },
    shown() {
      const { value, decimals } = this.field;
      return value === null ? '' : Number(value).toFixed(decimals);
    },
    place() { return this.held === null ? this.field.value : this.held; },
    isDown() { return this.field.value === true; },
  },
  methods: {
    press(value) { this.$emit('press', this.field.name, value); },
    type(event) {
      const number = parseFloat(event.target.value);
      if (Number.isFinite(number)) {
        const { minimum, maximum } = this.field;
        this.press(Math.min(maximum, Math.max(minimum, number)));
      } else if (this.field.special) this.press(null);
      event.target.value = this.shown;
    },
    slide(event) {
      this.held = Number(event.target.value);
      const now = performance.now();
      if (this.field.on_release || now - this.sentAt < PERIOD) return;
      this.sentAt = now;
      this.press(this.held);
    },
    slid() {
      if (this.held !== null) this.press(this.held);
      this.held = null;
    },
    choose(event) { this.press(this.field.choices[event.target.selectedIndex][1]); },
    ask() {
      if (this.field.saves) this.press({ saves: this.field.suffixes[0].slice(1) });
      else this.$refs.file.click();
    },
    give(event) {
      const [file] = event.target.files;
      event.target.value = '';
      if (file) this.press({ file });
    },
  },
  template: `
    <label v-if="field.kind === 'toggle'" class="sd-field sd-toggle" :title="field.tip">
      <input type="checkbox" :checked="isDown" :disabled="!field.enabled"
        @change="press($event.target.checked)"><span>{{ field.label }}</span>
    </label>
    <label v-else-if="field.kind === 'number' || field.kind === 'integer'"
        class="sd-field sd-number" :title="field.tip">
      <span>{{ field.label }}</span>
      <span class="sd-entry">
        <button v-if="field.special && field.value !== null" type="button" class="sd-reset"
          :title="field.special" @click.prevent="press(null)">↺</button>
        <i v-if="field.prefix && field.value !== null">{{ field.prefix }}</i>
        <input type="number" :value="shown" :min="field.minimum" :max="field.maximum"
          :step="field.step" :disabled="!field.enabled" :placeholder="field.special"
          @change="type" @keydown.enter="$event.target.blur()" @keydown.esc="$event.target.blur()">
        <i v-if="field.unit && field.value !== null">{{ field.unit }}</i>
      </span>
    </label>
    <label v-else-if="field.kind === 'slider'" class="sd-field sd-slider" :title="field.tip">
      <span>{{ field.label }}</span>
      <input type="range" :value="place" :min="field.minimum" :max="field.maximum"
        :step="field.step" :disabled="!field.enabled" @input="slide" @change="slid">
      <output>{{ place }}{{ field.unit.startsWith('(') ? '' : field.unit }}</output>
    </label>
    <label v-else-if="field.kind === 'choice'" class="sd-field sd-choice" :title="field.tip">
      <span>{{ field.label }}</span>
      <select :disabled="!field.enabled" @change="choose">
        <option v-for="[label, value] in field.choices" :key="label"
          :selected="value === field.value">{{ label }}</option>
      </select>
    </label>
    <div v-else-if="field.kind === 'label'" class="sd-field sd-label" :title="field.tip">
      <span>{{ field.label }}</span><output>{{ field.value }}</output>
    </div>
    <div v-else-if="field.kind === 'file'" class="sd-asks">
      <button type="button" class="sd-button" :title="field.tip" :disabled="!field.enabled"
        @click="ask">{{ field.label }}</button>
      <input v-if="!field.saves" ref="file" type="file" hidden :data-name="field.name"
        :aria-label="field.label" :accept="field.suffixes.join()" @change="give"></div>
    <button v-else type="button" class="sd-button" :class="{ down: isDown }" :title="field.tip"
        :disabled="!field.enabled" :aria-pressed="field.value === null ? null : isDown"
        @click="press(null)">
      <i v-if="icon" class="mdi" :class="icon"></i><span>{{ field.label }}</span>
    </button>`,
};

const Table = {
  props: { table: Object },
  emits: ['press'],
  data: () => ({ renamed: null }),
  methods: {
    select(row, event) {
      let keys = [row.key];
      if (this.table.multiple && (event.shiftKey || event.ctrlKey || event.metaKey)) {
        const chosen = this.table.rows.filter((each) => each.selected).map((each) => each.key);
        keys = row.selected ? chosen.filter((key) => key !== row.key) : [...chosen, row.key];
      }
      this.$emit('press', `${this.table.name}.select`, keys);
    },
    check(row, column, event) {
      this.$emit('press', `${this.table.name}.${column.name}`, [row.key, event.target.checked]);
    },
    rename(row) {
      if (!row.renamable) return;
      this.renamed = row.key;
      this.$nextTick(() => { const [box] = this.$refs.name || []; if (box) box.select(); });
    },
    named(row, event) {
      if (this.renamed === null) return;
      this.renamed = null;
      if (event.target.value !== row.label) {
        this.$emit('press', `${this.table.name}.rename`, [row.key, event.target.value]);
      }
    },
    colour: (row) => (row.colour ? `rgb(${row.colour.join(',')})` : 'transparent'),
  },
  template: `
    <div class="sd-table" :title="table.tip" :class="{ disabled: !table.enabled }" role="grid"
        :aria-label="table.title" :aria-multiselectable="table.multiple"
        :style="{ '--columns': table.columns.length }">
      <div class="sd-head" role="row"><span role="columnheader">{{ table.title }}</span>
        <span v-for="column in table.columns" :key="column.name" :title="column.tip"
          role="columnheader">{{ column.title }}</span></div>
      <div class="sd-rows" role="rowgroup">
        <div v-for="row in table.rows" :key="row.key" class="sd-row" role="row" tabindex="0"
            :aria-selected="row.selected" :class="{ selected: row.selected }"
            @keydown.self.enter.stop="select(row, $event)"
            @keydown.self.space.stop.prevent="select(row, $event)"
            @keydown.self.f2.stop="rename(row)" @keydown.tab.stop
            @click="select(row, $event)" @dblclick="rename(row)">
          <span class="sd-name" role="gridcell"><img v-if="row.picture" class="sd-picture" :src="row.picture" alt="">
            <i v-else class="sd-colour" :style="{ background: colour(row) }"></i>
            <input v-if="renamed === row.key" ref="name" type="text" :value="row.label"
              @click.stop @keydown.enter="$event.target.blur()"
              @keydown.esc="renamed = null" @blur="named(row, $event)">
            <span v-else>{{ row.label }}</span></span>
          <span v-for="(cell, k) in row.cells" :key="k" class="sd-cell" role="gridcell">
            <input v-if="cell.checked !== null" type="checkbox" :checked="cell.checked"
              :title="table.columns[k].tip" :aria-label="table.columns[k].title" @click.stop
              @change="check(row, table.columns[k], $event)">{{ cell.text }}</span>
        </div>
        <div v-if="!table.rows.length" class="sd-none" role="row">
          <span role="gridcell">None yet</span></div>
      </div>
    </div>`,
};

const Sections = {
  props: { sections: Array },
  emits: ['press'],
  methods: { press(...words) { this.$emit('press', ...words); } },
  template: `
    <section v-for="section in sections" :key="section.name" class="sd-section">
      <h2>{{ section.title }}</h2>
      <component :is="section.advice ? 'details' : 'div'">
        <summary v-if="section.advice">{{ section.advice }}</summary>
        <template v-for="(item, k) in section.items" :key="k">
          <sd-table v-if="item.rows" :table="item" @press="press"></sd-table>
          <div v-else-if="Array.isArray(item)" class="sd-line">
            <sd-field v-for="field in item" :key="field.name" :field="field" @press="press">
            </sd-field></div>
          <sd-field v-else :field="item" @press="press"></sd-field>
        </template>
      </component>
    </section>`,
};

const Menu = {
  props: { items: Array },
  emits: ['press'],
  methods: {
    use(field) {
      this.$emit('press', field.name, field.kind === 'toggle' ? field.value !== true : null);
    },
  },
  template: `
    <div class="sd-menu" role="menu">
      <template v-for="(item, k) in items" :key="k">
        <hr v-if="item === null">
        <div v-else-if="item.kind === 'menu'" class="sd-several"><span>{{ item.label }}</span>
          <button v-for="each in item.items" :key="each.name" type="button" role="menuitem"
            :class="{ down: each.value === true }" :disabled="!each.enabled" :title="each.tip"
            @click="use(each)">
            {{ each.label }}</button></div>
        <button v-else type="button" role="menuitem" :disabled="!item.enabled" :title="item.tip"
            @click="use(item)">
          <i class="mdi" :class="item.value === true ? 'mdi-check' : ''"></i>
          <span>{{ item.label }}</span></button>
      </template>
    </div>`,
};

const Tool = {
  props: { field: Object },
  emits: ['press'],
  computed: {
    icon() { return ICONS[this.field.icon] || ICONS[this.field.action] || 'mdi-circle-small'; },
    isDown() { return this.field.value === true; },
  },
  methods: {
    press(value) { this.$emit('press', this.field.name, value); },
    click() {
      if (this.field.kind !== 'hold') this.press(null);
    },
    hold(on) { if (this.field.kind === 'hold') this.press(on); },
  },
  template: `
    <v-menu v-if="field.kind === 'menu'" :disabled="!field.enabled">
      <template v-slot:activator="{ props }">
        <button type="button" class="sd-tool" v-bind="props" :title="field.tip"
          :aria-label="field.label" :disabled="!field.enabled" :data-name="field.name">
          <i class="mdi" :class="icon"></i><span>{{ field.label }}</span></button>
      </template>
      <sd-menu :items="field.items" @press="(...words) => $emit('press', ...words)"></sd-menu>
    </v-menu>
    <button v-else type="button" class="sd-tool" :class="{ down: isDown }" :title="field.tip"
        :disabled="!field.enabled" :aria-label="field.label" :data-name="field.name"
        :aria-pressed="field.value === null ? null : isDown"
        @keydown.enter="hold(true)" @keyup.enter="hold(false)" @click="click" @pointerdown="hold(true)" @pointerup="hold(false)"
        @pointerleave="$event.buttons && hold(false)">
      <i class="mdi" :class="icon"></i><span>{{ field.label }}</span></button>`,
};

export default {
  'sd-field': Field, 'sd-table': Table, 'sd-sections': Sections, 'sd-tool': Tool, 'sd-menu': Menu,
};

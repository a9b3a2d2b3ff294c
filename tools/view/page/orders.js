// What the user orders: E-STOP, re-arm, marks, recordings, gains. What the session answers is shown in a line.
const $ = (id) => document.getElementById(id);
const kNoAnswer_ms = 1500, kShown_ms = 8000, kDrag_ms = 100;

export class Orders {
  /** @param send(order) returns false when there is no connection. */
  constructor(send) {
    this.send = send;
    this.session = '';
    this.waiting = 0;
    this.sliders = new Map();
    $('estop').onpointerdown = () => this.estop();
    $('estop').onclick = (e) => { if (e.detail === 0) this.estop(); };  // by the keyboard
    $('rearm').onclick = () => this.order({ order: 'rearm' });
    $('record').onclick = () => this.order({ order: this.recording ? 'end_record' : 'record' });
    $('mark').onsubmit = (e) => {
      e.preventDefault();
      const text = $('mark-text').value.trim() || `mark ${new Date().toLocaleTimeString()}`;
      this.order({ order: 'mark', text });
      $('mark-text').value = '';
      $('mark-text').blur();
    };
  }

  estop() { this.order({ order: 'estop' }); }

  order(order) {
    const what = order.order === 'estop' ? 'E-STOP' : order.order;
    if (!this.send({ ...order, session: this.session })) {
      return this.say(`${what} NOT SENT: no connection. Use \`rtbus estop\`, or switch the device off`, false);
    }
    clearTimeout(this.waiting);
    this.waiting = setTimeout(
      () => this.say(`${what}: NO ANSWER. Use \`rtbus estop\`, or switch the device off`, false), kNoAnswer_ms);
  }

  answer(json) {
    clearTimeout(this.waiting);
    this.say(json.text, json.taken);
  }

  say(text, good) {
    $('answer').textContent = text;
    $('answer').dataset.level = good ? 'good' : 'bad';
    $('answer').hidden = false;
    clearTimeout(this.hiding);
    this.hiding = setTimeout(() => { $('answer').hidden = true; }, kShown_ms);
  }

  connected(is) { $('estop').dataset.connected = is; }

  /** Message `orders`. */
  state(json) {
    const more = json.live && !json.read_only;
    this.session = json.session;
    this.recording = json.recording;
    if (this.recorded !== undefined && json.recorded && json.recorded !== this.recorded) this.say(json.recorded, true);
    this.recorded = json.recorded;
    $('estop').hidden = !json.live;
    $('rearm').hidden = !(more && json.estop);
    $('mark').hidden = !(more && json.answers);
    $('record').hidden = !(more && json.records);
    $('record').setAttribute('aria-pressed', Boolean(json.recording));
    $('record').textContent = json.recording ? 'end recording' : 'record';
    $('record').title = json.recording ?? 'Record this session into a new file';
    $('no-orders').hidden = !more || json.answers;
    $('no-orders').textContent = json.why;
    this.gains(more ? json.adjustable : []);
  }

  gains(adjustable) {
    const keys = adjustable.map((each) => each.key).join();
    if (keys !== this.keys) {
      this.keys = keys;
      this.sliders = new Map(adjustable.map((each) => [each.key, this.slider(each)]));
      $('gains').replaceChildren(...[...this.sliders.values()].map((slider) => slider.label));
    }
    for (const each of adjustable) this.sliders.get(each.key).show(each);
  }

  slider({ key, unit, most }) {
    const label = document.createElement('label'), input = document.createElement('input'), text = document.createElement('span');
    Object.assign(input, { type: 'range', min: 0, max: most, step: most / 500 });
    label.append(text, input);
    const write = (value) => { text.textContent = `${key.replace('coupling.', '')}: ${Number(value).toPrecision(3)} ${unit}`; };
    let sentAt = 0, later = 0, held = false;
    const send = () => {
      sentAt = performance.now();
      this.order({ order: 'adjust', key, value: Number(input.value) });
    };
    input.oninput = () => {
      held = true;
      write(input.value);
      clearTimeout(later);
      later = setTimeout(send, Math.max(0, sentAt + kDrag_ms - performance.now()));
    };
    input.onchange = () => { held = false; };
    return { label, input, show: ({ value }) => { if (!held) { input.value = value; write(value); } } };
  }
}

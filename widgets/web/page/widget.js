// The editor in the output of a cell: its page in a frame, whose messages go to the kernel.
//
// The first is "open", which the kernel answers with the page; see tunnel.py.
const PATIENCE = 10000; // milliseconds without an answer, after which that is said
const PLACE = `position: relative; height: 570px; min-height: 320px; overflow: hidden;
  resize: vertical; border: 1px solid rgb(128 128 128 / 40%); border-radius: 4px`;
const FRAME = 'width: 100%; height: 100%; border: 0; display: block';
const STATUS = `position: absolute; left: 0; right: 0; bottom: 0; margin: 0; padding: 8px 12px;
  font: 13px sans-serif; color: #eee; background: rgb(30 32 36 / 85%)`;
const SILENT = 'The kernel does not answer. The editor waits for cells that run; if the kernel has '
  + 'ended, run the cell again.';
const ENDED = 'This editor is closed. Run the cell again to edit.';

const unpacked = (data) => new Response(
  new Blob([data]).stream().pipeThrough(new DecompressionStream('gzip'))).text();
// Return the bytes of a buffer, or of a view of one, in a buffer of their own.
const copied = (data) => new Uint8Array(
  data.buffer ?? data, data.byteOffset, data.byteLength).slice().buffer;

function render({ model, el }) {
  const page = `${Date.now()}-${Math.random()}`; // another one for each output
  const place = document.createElement('div'), frame = document.createElement('iframe');
  const status = document.createElement('p');
  let silence = 0;

  const say = (text) => {
    status.textContent = text;
    status.hidden = !text;
  };
  const send = ({ buffer, ...message }) => {
    silence ||= setTimeout(() => say(SILENT), PATIENCE);
    model.send({ ...message, page }, undefined, buffer ? [buffer] : []);
  };
  const relay = ({ source, data }) => {
    if (source === frame.contentWindow) send(data);
  };
  const hear = async (message, [view]) => {
    if (message.page !== page) return;
    clearTimeout(silence);
    silence = 0;
    say('');
    const buffer = view && copied(view);
    if (message.kind === 'document') {
      frame.srcdoc = await unpacked(buffer);
      for (const each of document.querySelectorAll(`.${model.get('picture')}`)) each.hidden = true;
    } else if (message.kind === 'ended') {
      model.off('msg:custom', hear); // pictures that are on their way say nothing any more
      frame.remove();
      say(ENDED);
    } else if (message.kind === 'refused') console.error(message.reason);
    else if (message.kind === 'ping') model.send({ kind: 'here', page });
    else frame.contentWindow?.postMessage({ ...message, buffer }, '*', buffer ? [buffer] : []);
  };

  place.style.cssText = PLACE;
  frame.title = 'segdeform';
  frame.style.cssText = FRAME;
  status.style.cssText = STATUS;
  status.role = 'status';
  place.append(frame, status);
  el.append(place);
  say('Starting the editor …');
  model.on('msg:custom', hear);
  window.addEventListener('message', relay);
  send({ kind: 'open' });
  return () => {
    model.off('msg:custom', hear);
    window.removeEventListener('message', relay);
    model.send({ kind: 'close', page });
    clearTimeout(silence);
  };
}

export default { render };

// In a frame of a notebook, before all other scripts: requests and the WebSocket of the page go to
// widget.js around the frame, and from there to the kernel; see tunnel.py.
(() => {
  const PART = 1 << 20; // bytes of a part of an upload
  const requests = new Map(); // by id
  let socket = null, last = 0;

  const send = (message, buffer) => window.parent.postMessage({ ...message, buffer }, '*');

  class Socket {
    constructor(url) {
      Object.assign(this, { url, readyState: 0, binaryType: 'blob' });
      socket = this;
      send({ kind: 'connect' });
    }

    send(data) {
      if (typeof data === 'string') send({ kind: 'frame', text: data });
      else send({ kind: 'frame' }, new Uint8Array(data).slice().buffer);
    }

    close() { send({ kind: 'close' }); }

    // Receive a message of the kernel.
    hear({ kind, buffer, text, reason }) {
      if (kind === 'connected') {
        this.readyState = 1;
        this.onopen?.({});
      } else if (kind === 'close') {
        this.readyState = 3;
        this.onclose?.({ reason });
      } else {
        const isBlob = buffer && this.binaryType === 'blob';
        this.onmessage?.({ data: isBlob ? new Blob([buffer]) : buffer ?? text });
      }
    }
  }

  // Ask for *path*, and send a *file* if there is one; resolve to its answer.
  function ask(path, query, file, progress) {
    last += 1;
    const id = last, size = file?.size;
    let start = 0;
    return new Promise((resolve) => {
      requests.set(id, async (message) => {
        if (message.kind === 'answer') {
          requests.delete(id);
          resolve(message);
          return;
        }
        const part = await file.slice(start, start + PART).arrayBuffer();
        start += part.byteLength;
        send({ kind: 'part', id }, part);
        progress?.({ loaded: start, total: size });
      });
      send({ kind: 'request', id, path, query, size });
    });
  }

  const parsed = (url) => {
    const { href, searchParams } = new URL(url, document.baseURI);
    const path = href.slice(document.baseURI.length).replace(/[?#].*/, '');
    return [path, Object.fromEntries(searchParams)];
  };

  class Request {
    upload = {};
    response = null;
    status = 0;
    setRequestHeader() {}
    open(_, url) { this.url = url; }
    async send(file) {
      const [path, query] = parsed(this.url);
      const answer = await ask(path, query, file, (event) => this.upload.onprogress?.(event));
      this.status = answer.status;
      this.responseText = new TextDecoder().decode(answer.buffer);
      this.onload?.({});
      this.onloadend?.({});
    }
  }

  window.WebSocket = Socket;
  window.XMLHttpRequest = Request;
  window.fetch = async (url) => {
    const { status, buffer } = await ask(...parsed(url));
    return new Response(buffer, { status });
  };
  window.history.replaceState = () => {}; // there is no address
  window.addEventListener('message', ({ source, data }) => {
    if (source !== window.parent || !data.kind) return;
    if (requests.has(data.id)) requests.get(data.id)(data);
    else socket?.hear(data);
  });
})();

// Messages of the server without a detour through the browser's store of blobs.
//
// wslink asks for each message as a Blob, slices it twice and reads the slices: four round trips to
// another process of the browser, which take longer than drawing a frame's message.  As an
// ArrayBuffer the same message is there at once.

// Let wslink read *data*, an ArrayBuffer, as if it was a Blob.
const readable = (data) => ({
  slice: (start, end) => ({ arrayBuffer: () => data.slice(start, end) }),
});

// Receive array buffers in the socket of *connection*, which is known from its next message on.
export default function receiveBuffers(connection) {
  const { prototype } = WebSocket, { send } = prototype, url = connection.getUrl();
  prototype.send = function sent(...data) {
    if (this.url === url && this.onmessage) {
      if (prototype.send === sent) prototype.send = send;
      const { onmessage } = this;
      this.binaryType = 'arraybuffer';
      this.onmessage = (event) => onmessage.call(this, event.data instanceof ArrayBuffer
        ? { data: readable(event.data) } : event);
    }
    return send.apply(this, data);
  };
}

// The WebSocket: it comes back by itself, and says of each frame when it has been shown.

const FIRST_RETRY_MS = 500;
const LAST_RETRY_MS = 5000;
const SILENT_MS = 4000; // the fleet is told four times a second: so long a silence is a dead connection
const NEEDS_TOKEN = 4401;
const FULL = 4429;

export class Connection {
  #socket = null;
  #retryMs = FIRST_RETRY_MS;
  #heardMs = 0;
  #wish = null;
  #timer = 0;

  /**
   * @param {object} listener `onFrame(buffer)` may return a promise that settles when the frame is shown;
   *   `onState(state, words)` with "wait", "open", "lost"; `onToken()` when the token is asked for.
   */
  constructor(listener) {
    this.listener = listener;
    setInterval(() => this.#watch(), 1000);
    addEventListener("online", () => this.open());
  }

  /** Open the socket unless it is open. */
  open() {
    clearTimeout(this.#timer);
    if (this.#socket !== null) return;
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/live`);
    socket.binaryType = "arraybuffer";
    this.#socket = socket;
    this.#heardMs = performance.now();
    socket.onopen = () => {
      if (this.#wish !== null) socket.send(JSON.stringify(this.#wish));
    };
    socket.onmessage = (event) => this.#hear(socket, event.data);
    socket.onclose = (event) => this.#lose(socket, event.code);
  }

  /** Ask for a vehicle; asked again after every reconnection. */
  watch(wish) {
    this.#wish = wish;
    if (this.#socket?.readyState === WebSocket.OPEN) this.#socket.send(JSON.stringify(wish));
  }

  async #hear(socket, data) {
    this.#heardMs = performance.now();
    this.#retryMs = FIRST_RETRY_MS;
    this.listener.onState("open", "");
    try {
      await this.listener.onFrame(data);
    } catch (error) {
      console.error(error);
    }
    if (socket.readyState === WebSocket.OPEN) socket.send('{"shown":1}');
  }

  #watch() {
    if (this.#socket !== null && performance.now() - this.#heardMs > SILENT_MS && !document.hidden) {
      const socket = this.#socket;
      socket.onclose = socket.onmessage = null;
      socket.close();
      this.#lose(socket, 0);
    }
  }

  #lose(socket, code) {
    if (this.#socket !== socket) return;
    this.#socket = null;
    if (code === NEEDS_TOKEN) {
      this.listener.onToken();
      return;
    }
    this.listener.onState("lost", code === FULL ? "too many browsers" : "ground station not reached");
    this.#timer = setTimeout(() => this.open(), this.#retryMs);
    this.#retryMs = Math.min(this.#retryMs * 1.6, LAST_RETRY_MS);
  }
}

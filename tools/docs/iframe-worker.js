// Search runs in a worker, which browsers refuse to pages from the disk. Those get one that runs in a hidden frame.
if (location.protocol === "file:") {
  window.Worker = window.IFrameWorker = class extends EventTarget {
    constructor(url) {
      super();
      const frame = document.createElement("iframe");
      frame.hidden = true;
      document.documentElement.append(frame);
      frame.worker = this;
      this.inside = frame.contentWindow;
      // What the worker posts arrives at this object.
      const answer = "postMessage = data => frameElement.worker.dispatchEvent(new MessageEvent('message', { data }))";
      this.ready = new Promise(resolve => { frame.begin = resolve; });
      frame.contentDocument.write(`<script>${answer}</script><script src="${new URL(url, location)}"></script>` +
        "<script>frameElement.begin()</script>");
      frame.contentDocument.close();
    }

    postMessage(data) {
      this.ready.then(() => this.inside.dispatchEvent(new MessageEvent("message", { data })));
    }
  };
}

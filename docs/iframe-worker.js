// Browsers start no worker on a page that was opened from the disk; there an inline frame runs the script of the site's
// search in its place.
if (location.protocol === "file:")
  window.Worker = class extends EventTarget {
    #ready;
    constructor(url) {
      super();
      const frame = document.createElement("iframe");
      frame.hidden = true;
      document.body.append(frame);
      const inside = (this.inside = frame.contentWindow);
      inside.postMessage = (data) => this.dispatchEvent(new MessageEvent("message", { data }));
      const script = inside.document.createElement("script");
      script.src = url;
      this.#ready = new Promise((loaded) => script.addEventListener("load", loaded));
      inside.document.body.append(script);
    }
    postMessage(data) {
      this.#ready.then(() => this.inside.dispatchEvent(new MessageEvent("message", { data })));
    }
  };

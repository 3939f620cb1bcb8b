// A search for an option as it is typed (--controls): the search engine reads a dash before a word as "pages without this word".
window.Worker = class extends Worker {
  postMessage(message) {
    const isQuery = message.type === 2; // Material for MkDocs: SearchMessageType.QUERY
    super.postMessage(isQuery ? { ...message, data: message.data.replace(/(^|[\s"])-+(?=\S)/g, "$1") } : message);
  }
};

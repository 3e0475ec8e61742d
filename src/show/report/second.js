// A second panel beside the map: this page in a frame, with parameters of its own. Both panels show the same part and layer.

const isSecond = document.documentElement.classList.contains("panel");
// The second panel: its frame and what it shows; none unless it is open.
/** @type {any} */ let second = null;
// What both panels showed last, as text.
let shared = "";

// Opens the second panel with what a link names.
/** @type {(text: string) => void} */
function openSecond(text) {
  if (second) {
    second.link = text;
    second.frame.contentWindow.postMessage({ panel: "link", link: text }, "*");
    return;
  }
  const copy = pristine.cloneNode(true);
  copy.className = "panel";
  const address = URL.createObjectURL(new Blob([`<!doctype html>${copy.outerHTML}`], { type: "text/html" }));
  const frame = Object.assign(element("iframe"), { id: "second", title: "The map with other parameters", src: address });
  frame.addEventListener("load", () => URL.revokeObjectURL(address));
  second = { frame, link: text };
  byId("views").append(frame);
  document.documentElement.classList.add("split");
  byId("compare").setAttribute("aria-pressed", "true");
}

function closeSecond() {
  second.frame.remove();
  second = null;
  document.documentElement.classList.remove("split");
  byId("compare").setAttribute("aria-pressed", "false");
  updateLink();
}

// Whether this panel knows what to show. Before that, it tells the page nothing.
let hasJoined = !isSecond;

const partner = () => (isSecond ? parent : second?.frame.contentWindow);

// Tells the other panel which part and layer are shown, if they changed here.
function share() {
  const now = JSON.stringify([view, layer]);
  if (now === shared || !hasJoined) return;
  shared = now;
  partner()?.postMessage({ panel: "show", view, layer }, "*");
}

// Tells the page what the link to its second panel is.
const shareLink = () => hasJoined && parent.postMessage({ panel: "state", link }, "*");

addEventListener("message", ({ source, data }) => {
  if (!data?.panel || source !== partner()) return;
  if (data.panel === "ready") {
    second.frame.contentWindow.postMessage({ panel: "link", link: second.link }, "*");
  } else if (data.panel === "link") {
    hasJoined = true;
    readLink(data.link);
  } else if (data.panel === "state") {
    second.link = data.link;
    updateLink();
  } else if (data.panel === "show") {
    shared = JSON.stringify([data.view, data.layer]);
    view = data.view;
    if (layer !== data.layer) showLayer(data.layer);
    keepInside();
  }
});

byId("compare").addEventListener("click", () => (second ? closeSecond() : openSecond(link)));

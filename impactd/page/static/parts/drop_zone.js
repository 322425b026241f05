// A place to drag files into; a file field for keyboard and phone.

import { h } from "../js/dom.js";
import { field } from "./fields.js";

const ACCEPTED = ".csv,.txt,.tsv,.dat,.asc,.gz,.npy,.npz,.wav,.uff,.unv,.tdms,.lvm,.json";

/** Return the place; `onFiles` gets an array. Until the signal, files can be dropped anywhere on the page. */
export function dropZone({ onFiles, signal }) {
  const chosen = field("Files", { type: "file", multiple: true, accept: ACCEPTED }, { hint: "CSV or other text with a column of times and one of the signal; also gzip, npy, npz, wav, uff, tdms, lvm. Up to 32 MiB a file." });
  chosen.input.addEventListener("change", () => { if (chosen.input.files.length) onFiles([...chosen.input.files]); chosen.input.value = ""; });
  const zone = h("div", { class: "drop-zone" }, h("p", { class: "large" }, "Drag your recordings here, or choose them."), chosen);
  const hover = (over) => zone.classList.toggle("over", over);
  addEventListener("dragover", (event) => { event.preventDefault(); hover(true); }, { signal });
  addEventListener("dragleave", (event) => { if (!event.relatedTarget) hover(false); }, { signal });
  addEventListener("drop", (event) => {
    event.preventDefault(); // else the browser leaves the page and shows the file
    hover(false);
    const files = [...(event.dataTransfer?.files ?? [])];
    if (files.length) onFiles(files);
  }, { signal });
  return zone;
}

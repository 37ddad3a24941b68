// Handles files that people drop on the page or choose: they are sent to the daemon, which has them played. The
// daemon's reports about them are shown beside the other controls, on all pages that have control.
import { FromDaemon, Play } from "./protocol";
import { bytes } from "./panels";

const kOnlyLook = "This page may only look. To play files, open the address for control that voxeld printed at its start.";

function element<K extends keyof HTMLElementTagNameMap>(kind: K, fields: Partial<HTMLElementTagNameMap[K]>): HTMLElementTagNameMap[K] {
  return Object.assign(document.createElement(kind), fields);
}

export class Dropped {
  private readonly target = element("div", { id: "drop", hidden: true });
  private readonly chooser = element("input", { id: "play-file", type: "file", hidden: true, tabIndex: -1 });
  private readonly choose = element("button", { id: "play", type: "button", textContent: "play a file…" });
  private readonly stop = element("button", { id: "stop-playing", type: "button", textContent: "stop", hidden: true });
  private readonly progress = element("progress", { id: "sending", max: 1, value: 0, hidden: true, ariaLabel: "How much of the file is sent" });
  private readonly cancel = element("button", { id: "cancel-sending", type: "button", textContent: "cancel", hidden: true });
  private readonly state = element("p", { id: "playing", role: "status" });
  private readonly trouble = element("p", { id: "not-played", role: "alert", hidden: true });
  private control = false;
  private play: Play = {};
  private sending: XMLHttpRequest | null = null;

  // `over` is what files are dropped on, `among` holds the other controls, and `say` informs people without control.
  constructor(over: HTMLElement, among: HTMLElement, private readonly send: (message: object) => void, private readonly say: (text: string) => void) {
    const row = element("div", { className: "play" });
    this.chooser.ariaLabel = "A file to play";
    row.append(this.choose, this.stop, this.chooser);
    const sending = element("div", { className: "play" });
    sending.append(this.progress, this.cancel);
    among.append(row, sending, this.state, this.trouble);
    over.append(this.target);

    this.choose.addEventListener("click", () => this.chooser.click());
    this.chooser.addEventListener("change", () => {
      const file = this.chooser.files?.[0];
      if (file !== undefined) this.take(file);
      this.chooser.value = ""; // so that the same file may be chosen again
    });
    this.stop.addEventListener("click", () => this.send({ stop: true }));
    this.cancel.addEventListener("click", () => this.sending?.abort());

    // A file that is dropped elsewhere must not replace the page.
    for (const kind of ["dragover", "drop"]) {
      addEventListener(kind, (event) => {
        if (!hasFiles(event as DragEvent)) return;
        event.preventDefault();
        (event as DragEvent).dataTransfer!.dropEffect = "none";
      });
    }
    over.addEventListener("dragover", (event) => {
      if (!hasFiles(event)) return;
      event.preventDefault();
      event.stopPropagation();
      const refused = this.refusal();
      event.dataTransfer!.dropEffect = "copy"; // also for a file that is refused, so that the reason is shown
      this.target.textContent = refused ?? "Drop the file here, and it plays";
      this.target.classList.toggle("refused", refused !== null);
      this.target.hidden = false;
    });
    over.addEventListener("dragleave", (event) => {
      if (!(event.relatedTarget instanceof Node) || !over.contains(event.relatedTarget)) this.target.hidden = true;
    });
    over.addEventListener("drop", (event) => {
      if (!hasFiles(event)) return;
      event.preventDefault();
      event.stopPropagation();
      this.target.hidden = true;
      this.drop(event.dataTransfer!);
    });
  }

  // Handles the daemon's messages that concern files.
  told(message: FromDaemon): void {
    if (message.hello !== undefined) {
      this.control = message.hello.control;
      this.play = {};
    }
    if (message.play !== undefined) this.play = message.play;
    if (message.hello !== undefined || message.play !== undefined) this.show();
  }

  private show(): void {
    const { playing, failed, why, why_not: whyNot } = this.play;
    this.choose.disabled = whyNot !== undefined || this.sending !== null;
    this.stop.hidden = playing === undefined;
    this.state.textContent = playing !== undefined ? `playing ${playing}` : whyNot ?? "";
    if (failed === undefined) this.complain("");
    else if (why?.startsWith(`${failed}: `)) this.complain(`Not played: ${why}`); // an error in the file itself
    else this.complain(`${failed} was not played: ${why ?? ""}`);
  }

  private complain(text: string): void {
    this.trouble.textContent = text;
    this.trouble.hidden = text === "";
    if (text !== "" && this.trouble.offsetParent === null) this.say(text); // the panel is hidden
  }

  // Returns why no file is accepted; null if one is.
  private refusal(): string | null {
    if (!this.control) return kOnlyLook;
    if (this.play.why_not !== undefined) return `Files are not played here: ${this.play.why_not}`;
    return this.sending !== null ? "Another file is being sent" : null;
  }

  private drop(data: DataTransfer): void {
    const refused = this.refusal();
    if (refused !== null) return this.say(refused);
    const file = data.files[0];
    if (data.items[0]?.webkitGetAsEntry?.()?.isDirectory) return this.complain("That is a folder; one file is played at a time.");
    if (file === undefined || data.files.length > 1) return this.complain(`Those are ${data.files.length} files; one is played at a time.`);
    this.take(file);
  }

  private take(file: File): void {
    const most = this.play.max_bytes ?? Infinity;
    if (file.size > most) return this.complain(`${file.name} has ${bytes(file.size)}; files up to ${bytes(most)} are played (server.http_max_upload_bytes).`);
    if (file.size === 0) return this.complain(`${file.name} is empty, or is not a file.`);
    this.complain("");
    const request = new XMLHttpRequest(); // fetch does not report progress
    this.sending = request;
    this.progress.value = 0;
    this.progress.hidden = this.cancel.hidden = false;
    this.choose.disabled = true;
    request.upload.onprogress = (event) => (this.progress.value = event.loaded / Math.max(1, event.total));
    request.onload = () => this.sent(request.status === 202 ? "" : `${file.name} was not taken: ${request.responseText.trim()}`);
    request.onerror = () => this.sent(`${file.name} was not sent: the connection broke off, or the file cannot be read.`);
    request.onabort = () => this.sent(`${file.name} was not sent.`);
    request.open("POST", `/play?name=${encodeURIComponent(file.name)}`);
    request.send(file);
  }

  private sent(trouble: string): void {
    this.sending = null;
    this.progress.hidden = this.cancel.hidden = true;
    this.show();
    if (trouble !== "") this.complain(trouble);
  }
}

function hasFiles(event: DragEvent): boolean {
  return event.dataTransfer?.types.includes("Files") ?? false;
}

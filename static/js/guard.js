/* Keeps an impatient second press from sending a form twice, and never blocks a later try. */

export const RETRY_AFTER_MS = 4000;

/**
 * Guard every form marked `data-guard` that is not sent in the background.
 *
 * The server stores a page once however often it comes; this only spares people the notice. The guard ends by
 * itself, because a connection can fail without the page hearing of it, and when the page comes back from the
 * browser's history.
 */
export function guardForms(root) {
  root.querySelectorAll("form[data-guard]:not([data-send])").forEach((form) => {
    let timer = null;
    const open = () => {
      clearTimeout(timer);
      timer = null;
      showSending(form, false);
    };
    form.addEventListener("submit", (event) => {
      if (timer !== null) {
        event.preventDefault();
        return;
      }
      timer = setTimeout(open, RETRY_AFTER_MS);
      showSending(form, true);
    });
    window.addEventListener("pageshow", open);
  });
}

/** Show on a form's buttons whether it is on its way. A button keeps its focus and its place in the tab order. */
export function showSending(form, isSending) {
  form.querySelectorAll("button[type=submit]").forEach((button) => {
    if (isSending) {
      button.setAttribute("aria-disabled", "true");
    } else {
      button.removeAttribute("aria-disabled");
    }
    if (button.dataset.sending) {
      button.dataset.label ??= button.textContent;
      button.textContent = isSending ? button.dataset.sending : button.dataset.label;
    }
  });
}

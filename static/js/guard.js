/* Keeps an impatient second press from sending a form twice, and never blocks a later try. */

const RETRY_AFTER_MS = 4000;

/**
 * Guard every form marked `data-guard`.
 *
 * The server stores a page once however often it comes; this only spares people the notice. The guard ends by
 * itself, because a connection can fail without the page hearing of it, and when the page comes back from the
 * browser's history.
 */
export function guardForms(root) {
  root.querySelectorAll("form[data-guard]").forEach((form) => {
    let timer = null;
    const open = () => {
      clearTimeout(timer);
      timer = null;
      show(form, false);
    };
    form.addEventListener("submit", (event) => {
      if (timer !== null) {
        event.preventDefault();
        return;
      }
      timer = setTimeout(open, RETRY_AFTER_MS);
      show(form, true);
    });
    window.addEventListener("pageshow", open);
  });
}

/* The button keeps its focus and its place in the tab order: it is not `disabled`. */
function show(form, isSending) {
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

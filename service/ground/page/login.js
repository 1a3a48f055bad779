// The way in. The token travels behind # in the address, which a browser sends to nobody, and is taken out of it.

const dialog = document.getElementById("login");
const form = document.getElementById("login-form");
const field = document.getElementById("token");
const error = document.getElementById("login-error");

async function tell(token) {
  const answer = await fetch("/login", {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify({ token }),
  });
  return answer.ok;
}

async function isKnown() {
  try {
    return (await fetch("/session", { cache: "no-store" })).status !== 401;
  } catch {
    return true; // not reached: the connection says so, and tries again
  }
}

function ask() {
  return new Promise((resolve) => {
    error.textContent = "";
    if (!dialog.open) dialog.showModal();
    form.onsubmit = async (event) => {
      event.preventDefault();
      try {
        if (await tell(field.value.trim())) {
          field.value = "";
          dialog.close();
          resolve();
        } else {
          error.textContent = "This is not the token.";
          field.select();
        }
      } catch {
        error.textContent = "The ground station is not reached.";
      }
    };
    dialog.oncancel = (event) => event.preventDefault();
  });
}

/** Resolves when this browser may look. */
export async function logIn() {
  const token = new URLSearchParams(location.hash.slice(1)).get("token");
  if (token !== null) {
    history.replaceState(null, "", location.pathname);
    try {
      if (await tell(token)) return;
    } catch {
      // not reached: asked below
    }
  }
  if (!(await isKnown())) await ask();
}

"""What the viewer adds to viser's page: dark where the reader's system is dark, contrast, room on a phone,
names of all controls for screen readers.

viser has a dark page, which the address `?darkMode` asks for, but does not ask the browser for its reader's
choice, and it has no place for a style sheet but an element of the panel. The event `load` of a `style`
element runs the script, as scripts in such an element do not run.
"""

from html import escape

_SCRIPT = """
const dark = matchMedia('(prefers-color-scheme: dark)');
const follow = () => {
  const address = new window.URL(location.href);
  if (address.searchParams.has('darkMode') === dark.matches) return;
  if (dark.matches) address.searchParams.set('darkMode', '');
  else address.searchParams.delete('darkMode');
  location.replace(address);
};
document.title = 'contactsense';
if (dark.matches) follow();
dark.addEventListener('change', follow);
// viser names the first control of a row only, and no slider.
const name = () => {
  for (const label of document.querySelectorAll('p > label[for]')) {
    const row = label.parentElement.parentElement.parentElement;
    const controls = row.querySelectorAll('[role="slider"], input:not([type="hidden"])');
    controls.forEach((control, i) => {
      if (controls.length === 1 && control.labels?.length) return;
      const axis = controls.length === 3 ? ' ' + 'xyz'[i] : '';
      control.setAttribute('aria-label', label.textContent + axis);
    });
  }
};
let waiting;
const later = () => { waiting ??= setTimeout(() => { waiting = undefined; name(); }, 200); };
new MutationObserver(later).observe(document.body, { childList: true, subtree: true });
later();
"""
_STYLE = """
:root[data-mantine-color-scheme="light"] { --mantine-color-dimmed: #56606a; }
:root[data-mantine-color-scheme="dark"] { --mantine-color-dimmed: #b4bcc4; }
p, li { overflow-wrap: anywhere; }
table th { text-align: left; }
table th, table td { padding-right: 0.3em; }
/* Names of links: long ones are broken, those of UR arms also fit beside the numbers into the narrower panel
that viser shows where its page begins before it knows the width. */
td:first-child { overflow-wrap: anywhere; min-width: 6.6em; }
td:not(:first-child) { white-space: nowrap; } /* numbers with their units */
.mantine-NumberInput-root[style*="width: 3rem"] { width: 4.5rem !important; }
@media (max-width: 36em) {
  [style*="max-height: 60%"] { width: 100% !important; max-height: 50% !important; }
  [style*="max-height: 60%"] [style="width: 20em;"] { width: 100% !important; }
}
"""
STYLE = f'<style onload="{escape(_SCRIPT)}">{_STYLE}</style>'
"""Content of an HTML element of the panel."""

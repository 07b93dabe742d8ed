"""What the viewer adds to viser's page: dark where the reader's system is dark, contrast, room on a phone.

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
"""
_STYLE = """
:root[data-mantine-color-scheme="light"] { --mantine-color-dimmed: #56606a; }
:root[data-mantine-color-scheme="dark"] { --mantine-color-dimmed: #b4bcc4; }
p, li { overflow-wrap: anywhere; }
table th { text-align: left; }
.mantine-NumberInput-root[style*="width: 3rem"] { width: 4.5rem !important; }
@media (max-width: 36em) {
  [style*="max-height: 60%"] { width: 100% !important; max-height: 50% !important; }
  [style*="max-height: 60%"] [style="width: 20em;"] { width: 100% !important; }
}
"""
STYLE = f'<style onload="{escape(_SCRIPT)}">{_STYLE}</style>'
"""Content of an HTML element of the panel."""

#!/bin/sh
# Lists the sentences of more than 30 words in the Markdown pages; fails when there is one.
# Code blocks, tables and headings are left out; code in backquotes, a link's address and a picture count as one word or none.
# usage: sentences.sh ROOT [PAGE…]
set -eu
cd "$1"
shift
if [ $# -eq 0 ]; then
  # shellcheck disable=SC2046  # names of pages have no spaces
  set -- $(find . -name '*.md' -not -path './.*' -not -path './build*' -not -path './out*' -not -path './tests/data/*' -not -path '*/node_modules/*' | sort)
fi
awk -v limit=30 '
function finish(   copy, parts, n, i, count, token, words, k) {
  if (text == "") return
  gsub(/!\[[^]]*\]\([^)]*\)/, "", text)            # pictures
  gsub(/\]\([^)]*\)/, "]", text)                   # addresses of links
  gsub(/`[^`]*`/, "code", text)
  gsub(/[.!?][)*"]*[ ]+/, "&\n", text)
  n = split(text, parts, /\n/)
  for (i = 1; i <= n; i++) {
    copy = parts[i]
    if (held ~ /(Fig|Figs|eq|et al)\.[)*"]*[ ]+$/) copy = held copy   # no end of a sentence
    held = copy
    count = split(copy, token, /[[:space:]]+/)
    words = 0
    for (k = 1; k <= count; k++) if (token[k] ~ /[[:alnum:]]/) words++
    if (words > limit) {
      printf "%s:%d: %d words: %s\n", page, start, words, copy
      bad++
    }
  }
  text = held = ""
}
FNR == 1 { finish(); fenced = 0 }
/^[ ]*```/ { finish(); fenced = !fenced; next }
fenced { next }
/^[[:space:]]*$/ || /^#/ || /^[ ]*\|/ { finish(); blank = 1; next }
/^    / && blank && text == "" { next }                # an indented code block
/^[ ]*([-*]|[0-9]+\.)[ ]/ { finish(); sub(/^[ ]*([-*]|[0-9]+\.)[ ]+/, "") }
{ if (text == "") { start = FNR; page = FILENAME } text = text " " $0; blank = 0 }
END { finish(); if (bad) { printf "%d sentences of more than %d words\n", bad, limit; exit 1 } }
' "$@"

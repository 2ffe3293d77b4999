# Copies documents, named relative to the working folder, below the folder `to`. A link to what is not among them (a header, a
# maintainers' document) becomes its text: it would lead nowhere after installation.
# Usage: awk -v to=FOLDER -v others="FILES" -f documents.awk DOCUMENTS; others: what is installed, too, and not copied here.
function install(path) {
  for (; path != "" && !(path in installed); sub(/\/?[^\/]*$/, "", path)) installed[path] = 1
}
# "a/b/../c" -> "a/c"
function normal(path) {
  gsub(/\/\.\//, "/", path)
  while (match(path, /[^\/]+\/\.\.(\/|$)/))
    path = substr(path, 1, RSTART - 1) substr(path, RSTART + RLENGTH)   # documents name nothing above the top folder
  sub(/\/$/, "", path)
  return path
}
function leads_nowhere(link, folder) {
  if (link ~ /^(https?:|mailto:|#)/) return 0
  sub(/#.*/, "", link)
  return !(normal(folder link) in installed)
}
# The place of the bracket that the one after `text` closes.
function opening(text, i, depth, c) {
  for (i = length(text); i > 0; --i) {
    c = substr(text, i, 1)
    if (c == "]") ++depth
    if (c == "[" && depth-- == 0) return i
  }
  return 0
}
function rewritten(text, folder, out, link, at) {
  while (match(text, /\]\([^) \t\n]+\)/)) {
    link = substr(text, RSTART + 2, RLENGTH - 3)
    out = out substr(text, 1, RSTART - 1)
    text = substr(text, RSTART + RLENGTH)
    at = leads_nowhere(link, folder) ? opening(out) : 0
    if (at) out = substr(out, 1, at - 1) substr(out, at + 1)
    else out = out "](" link ")"
  }
  return out text
}
function flush() {
  printf "%s", rewritten(prose, folder) > file
  prose = ""
}
BEGIN {
  for (i = 1; i < ARGC; ++i) install(ARGV[i])
  n = split(others, names, " ")
  for (i = 1; i <= n; ++i) install(names[i])
}
FNR == 1 {
  if (file) { flush(); close(file) }
  file = to "/" FILENAME
  folder = FILENAME
  sub(/[^\/]*$/, "", folder)
  is_code = 0
}
/^```/ {
  flush()
  is_code = !is_code
  print > file
  next
}
is_code { print > file; next }
{ prose = prose $0 "\n" }
END { flush() }

# Makes Debian's changelog from CHANGELOG.md: awk -v version=0.2.0 -v by="NAME <MAIL>" -f changelog.awk CHANGELOG.md
# "## Unreleased" may stand first: it is merged into the entry of `version`, which is the next heading.
function begin(entry_version) {
  printf "%shuetrack (%s) unstable; urgency=medium\n\n", separator, entry_version
  separator = "\n"
  is_open = 1
}
function end(day,    command, date) {
  command = "date --utc --rfc-email --date=" day
  command | getline date
  close(command)
  printf "\n -- %s  %s\n", by, date
  is_open = 0
}
/^## / {
  if ($2 == "Unreleased") {
    begin(version)
    next
  }
  if ($2 == version) is_found = 1
  else if (!is_found) exit  # reported in END
  if (is_open && $2 != version) end(day)
  if (!is_open) begin($2)
  day = $3
  gsub(/[()]/, "", day)
  next
}
is_open && /^- / { print "  * " substr($0, 3) }
is_open && /^  / { print "  " $0 }
END {
  if (!is_found) {
    print "CHANGELOG.md has no heading '## " version " (YYYY-MM-DD)', or an older version stands above it" > "/dev/stderr"
    exit 1
  }
  end(day)
}

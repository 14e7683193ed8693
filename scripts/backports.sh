# shellcheck shell=bash disable=SC2034
# Sourced by scripts/setup.
#
# Prints the source of suite "$2" among the apt sources in folder "$1" as a source of that suite's
# backports: same mirror, same options, same signing key, component main. Leaves the ending that the
# format asks for (`sources` is deb822, `list` is one line) in `source_suffix`. 1 if there is no source.
#
# Nothing is written down here that the machine does not say itself: a mirror behind a company's wall,
# a key in another place or a cache in front of the archive keep working.
backports_source() {
    local apt=$1 suite=$2 file
    for file in "$apt"/sources.list.d/*.sources; do
        [ -e "$file" ] || continue
        source_suffix=sources
        awk -v suite="$suite" '
            function has(list, word, n, words, i) {
                n = split(list, words)
                for (i = 1; i <= n; i++) if (words[i] == word) return 1
                return 0
            }
            function stanza_ends() {
                if (!found && has(value["types"], "deb") && has(value["suites"], suite) &&
                    has(value["components"], "main") && value["enabled"] !~ /no|false|off|disable|0/) {
                    printf "Types: deb\nSuites: %s-backports\nComponents: main\n%s", suite, kept
                    found = 1
                }
                kept = ""
                split("", value)
            }
            /^#/ { next }
            /^[ \t]*$/ { stanza_ends(); next }
            !/^[ \t]/ { field = tolower($0); sub(/:.*/, "", field) }
            {
                text = $0
                if (text !~ /^[ \t]/) sub(/^[^:]*:/, "", text)
                value[field] = value[field] " " text
                if (field !~ /^(types|suites|components|enabled)$/) kept = kept $0 "\n"
            }
            END { stanza_ends(); exit !found }
        ' "$file" && return
    done
    for file in "$apt/sources.list" "$apt"/sources.list.d/*.list; do
        [ -e "$file" ] || continue
        source_suffix=list
        # deb [options] URI suite components: the options may hold spaces.
        awk -v suite="$suite" '
            $1 != "deb" { next }
            {
                sub(/#.*/, "")
                options = ""
                rest = $0
                sub(/^[ \t]*deb[ \t]+/, "", rest)
                if (rest ~ /^\[/) {
                    options = rest
                    sub(/\].*/, "] ", options)
                    sub(/^\[[^]]*\][ \t]*/, "", rest)
                }
                n = split(rest, word)
                if (word[2] != suite) next
                for (i = 3; i <= n; i++) if (word[i] == "main") {
                    printf "deb %s%s %s-backports main\n", options, word[1], suite
                    found = 1
                    exit
                }
            }
            END { exit !found }
        ' "$file" && return
    done
    return 1
}

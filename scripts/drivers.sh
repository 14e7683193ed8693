# shellcheck shell=bash
# Where this machine keeps the Vulkan drivers that the project runs on. Sourced by scripts/setup, ./demo
# and ./check, so that each path is written down once. Every function prints a path, or nothing.

# Mesa's software driver. Distributions name the file with or without the architecture.
lavapipe_json() {
    local json
    for json in /etc/vulkan/icd.d/lvp_icd*.json /usr/local/share/vulkan/icd.d/lvp_icd*.json \
        /usr/share/vulkan/icd.d/lvp_icd*.json; do
        if [ -e "$json" ]; then
            echo "$json"
            return
        fi
    done
}

# Mesa's version as the package manager knows it (`25.0.7-2`); nothing where it does not know.
lavapipe_version() {
    { dpkg-query --show --showformat='${Version}' mesa-vulkan-drivers 2>/dev/null || true; } | sed 's/^[0-9]*://'
}

# The folder that scripts/setup unpacks SwiftShader into. Outside the checkout: it outlives `git clean`,
# and every checkout shares it.
swiftshader_folder() {
    echo "${XDG_CACHE_HOME:-${HOME:-/tmp}/.cache}/tilewright/swiftshader"
}

# The second software driver, which shares no code with Mesa.
swiftshader_json() {
    local json
    for json in "${TILEWRIGHT_SWIFTSHADER:-}" "$(swiftshader_folder)/vk_swiftshader_icd.json" \
        /usr/lib/chromium/vk_swiftshader_icd.json; do
        if [ -n "$json" ] && [ -e "$json" ] && [ -e "$(dirname "$json")/libvk_swiftshader.so" ]; then
            echo "$json"
            return
        fi
    done
}

# shellcheck shell=bash
# An apt of our own, for scripts that unpack packages without installing them: sourced.
#
#   private_apt FOLDER          readies it: the machine's mirrors, proxy and certificates; none of its hooks, and not its list of what
#                               is installed, so that what comes depends on the release alone. Sets APT_CONFIG.
#   private_update FOLDER       fetches the lists of packages; false when none came
#   private_why FOLDER          what the last command said went wrong, in a few lines

private_apt() {
    local work=$1
    rm -rf "$work"
    mkdir -p -m 700 "$work" # the settings may hold a proxy's password
    mkdir -p "$work"/{lists/partial,archives/partial,none,root}
    : >"$work/status"
    {
        apt-config dump | grep -E '^Acquire::' | grep -vE '^Acquire::(IndexTargets|Changelogs)' || true
        cat <<END
Dir::Etc::Main "/dev/null";
Dir::Etc::Parts "$work/none";
Dir::State::Lists "$work/lists";
Dir::State::status "$work/status";
Dir::Cache "$work";
Dir::Cache::Archives "$work/archives";
Dir::Log "$work";
Debug::NoLocking "1";
APT::Sandbox::User "root";
APT::Install-Recommends "0";
Acquire::Languages { "none"; };
Acquire::Retries "3";
END
    } >"$work/apt.conf"
    export APT_CONFIG=$work/apt.conf
}

# A mirror of somebody else's that does not answer is no matter as long as the release's own does.
private_update() {
    apt-get --quiet update >"$1/log" 2>&1 || true
    ls "$1"/lists/*Packages* >/dev/null 2>&1
}

private_why() {
    grep -E '^[EW]:' "$1/log" | head -n 3 >&2 || true
}

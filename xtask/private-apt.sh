# shellcheck shell=bash
# Functions for a private apt, for scripts that unpack packages without installing them. Source this file.
#
#   private_apt FOLDER          sets it up in FOLDER and sets APT_CONFIG. It uses the machine's mirrors, proxy and certificates, but not its
#                               hooks, and an empty list of installed packages, so that the result depends only on the release.
#   private_update FOLDER       fetches the lists of packages; fails when there are none
#   private_why FOLDER          prints the errors and warnings of the last command, at most three lines
#   private_unpack FOLDER NAMES unpacks what apt has fetched in FOLDER/apt into FOLDER/root, and lists it in FOLDER/packages.txt: all but the C
#                               and C++ libraries, because a process can have only one of each, the machine's; what only an installation
#                               needs; and packages whose whole name the regular expression NAMES matches

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

# Ignores the exit code: a third-party mirror that does not answer does no harm if the release's own mirror does.
private_update() {
    apt-get --quiet update >"$1/log" 2>&1 || true
    ls "$1"/lists/*Packages* >/dev/null 2>&1
}

private_why() {
    grep -E '^[EW]:' "$1/log" | head -n 3 >&2 || true
}

private_unpack() {
    local folder=$1 left_out=$2 package name version
    rm -rf "$folder/root"
    mkdir "$folder/root"
    : >"$folder/packages.txt"
    for package in "$folder"/apt/archives/*.deb; do
        read -r name version < <(dpkg-deb -W --showformat='${Package} ${Version}\n' "$package")
        case $name in
            libc6 | libc-bin | libcrypt1 | libgcc-s1 | gcc-*-base | libstdc++6) continue ;;
            debconf | dpkg | perl* | libperl* | tar | libselinux1 | libpam*) continue ;; # to install with
        esac
        if [[ $name =~ ^($left_out)$ ]]; then continue; fi
        dpkg-deb -x "$package" "$folder/root"
        echo "$name $version" >>"$folder/packages.txt"
    done
}

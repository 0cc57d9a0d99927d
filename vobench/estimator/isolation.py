"""Isolates the process of an estimator: a private mount tree, namespaces, no capabilities, and few system calls.

The process that becomes the estimator, or the first process of its namespace, calls `enter`. A layer that the kernel
does not allow is omitted and reported. See namespaces(7), pivot_root(2), capabilities(7), seccomp(2), landlock(7).

This module runs in a bare interpreter and imports nothing of vobench, because an estimator should start quickly.
"""

import ctypes
import errno
import os
import struct

# What an estimator can see if the kernel does not allow a layer of the isolation.
FILES = "the user's files"
NAMES = "names and permissions of the user's files"
PROCESSES = "other processes"
NETWORK = "the network"
SHARED_MEMORY = "shared memory of other processes"
SYSTEM_CALLS = "every system call"

# linux/sched.h
CLONE_NEWTIME = 0x00000080
CLONE_NEWNS = 0x00020000
CLONE_NEWCGROUP = 0x02000000
CLONE_NEWUTS = 0x04000000
CLONE_NEWIPC = 0x08000000
CLONE_NEWUSER = 0x10000000
CLONE_NEWPID = 0x20000000
CLONE_NEWNET = 0x40000000
CLONE_ANY_NEW = (
    CLONE_NEWTIME
    | CLONE_NEWNS
    | CLONE_NEWCGROUP
    | CLONE_NEWUTS
    | CLONE_NEWIPC
    | CLONE_NEWUSER
    | CLONE_NEWPID
    | CLONE_NEWNET
)
# linux/mount.h
MS_RDONLY = 1
MS_NOSUID = 2
MS_NODEV = 4
MS_NOEXEC = 8
MS_REMOUNT = 32
MS_BIND = 4096
MS_REC = 16384
MS_PRIVATE = 1 << 18
MNT_DETACH = 2
# linux/prctl.h
PR_SET_DUMPABLE = 4
PR_CAPBSET_DROP = 24
PR_SET_NO_NEW_PRIVS = 38
PR_CAP_AMBIENT = 47
PR_CAP_AMBIENT_CLEAR_ALL = 4
PR_SET_SECCOMP = 22
# linux/capability.h
CAPABILITY_VERSION = 0x20080522
MOST_CAPABILITIES = 64

# The system's programs and libraries. The last three are those of NixOS and Guix.
SYSTEM = (
    "/usr",
    "/bin",
    "/sbin",
    "/lib",
    "/lib32",
    "/lib64",
    "/libx32",
    "/nix/store",
    "/gnu/store",
    "/run/current-system",
)
# Settings that the loader, fonts, drivers and programs with alternatives read.
SETTINGS = (
    "/etc/alternatives",
    "/etc/fonts",
    "/etc/glvnd",
    "/etc/hosts",
    "/etc/ld.so.cache",
    "/etc/ld.so.conf",
    "/etc/ld.so.conf.d",
    "/etc/localtime",
    "/etc/OpenCL",
    "/etc/vulkan",
)
DEVICES = ("/dev/null", "/dev/zero", "/dev/full", "/dev/random", "/dev/urandom")
# The devices of graphics processors: Mesa's drivers, AMD's compute driver, WSL, and those of NVIDIA by their prefix.
GRAPHICS = ("/dev/dri", "/dev/kfd", "/dev/dxg")
GRAPHICS_PREFIX = "nvidia"
PROCESSORS = ("/sys/devices/system/cpu", "/sys/devices/system/node")
# Files of /proc that show the machine instead of the processes of the namespace. Root needs no capability to read them.
MASKED = (
    "allocinfo",
    "iomem",
    "ioports",
    "kcore",
    "key-users",
    "keys",
    "kmsg",
    "kpagecgroup",
    "kpagecount",
    "kpageflags",
    "locks",
    "pagetypeinfo",
    "sched_debug",
    "slabinfo",
    "timer_list",
    "vmallocinfo",
)
LINKS_OF_DEV = (
    ("/dev/fd", "/proc/self/fd"),
    ("/dev/stdin", "/proc/self/fd/0"),
    ("/dev/stdout", "/proc/self/fd/1"),
    ("/dev/stderr", "/proc/self/fd/2"),
)
ROOT_SIZE = "16m"
INODE_BYTES = 4096  # each file takes at least one block

libc = ctypes.CDLL(None, use_errno=True)


def new_pid_namespace() -> bool:
    """Put future children of this process in a new process namespace, and return whether the kernel allows it.

    Without the privileges of root, this requires a new user namespace.
    """
    user = os.getuid()
    group = os.getgid()
    try:
        if libc.unshare(CLONE_NEWPID) == 0:
            return True
        if libc.unshare(CLONE_NEWUSER | CLONE_NEWPID):
            return False
        maps = (("setgroups", "deny"), ("uid_map", f"{user} {user} 1"), ("gid_map", f"{group} {group} 1"))
        for name, text in maps:
            with open(f"/proc/self/{name}", "w") as file:
                file.write(text)
    except (OSError, AttributeError):
        return False
    return True


def enter(plan: dict[str, object], *, has_pid_namespace: bool) -> tuple[list[str], str, list[int]]:
    """Isolate this process and all of its descendants, as far as the kernel allows.

    `plan` is the result of `guard_plan`. Returns what the process can still see; the reason why the kernel did not
    allow a private mount tree, empty if it did; and the descriptors of the private file systems, as in
    `_Tree.descriptors`.
    """
    sees = []
    why = ""
    descriptors: list[int] = []
    has_own_proc = False
    before = os.umask(0o022)
    try:
        has_own_proc, descriptors = _enter_mount_tree(plan, has_pid_namespace=has_pid_namespace)
    except OSError as error:
        why = str(error.strerror)
    os.umask(before)
    _prctl(PR_SET_NO_NEW_PRIVS, 1)
    if not descriptors:
        sees.append(NAMES if _restrict_files(plan) else FILES)
        sees.append(SHARED_MEMORY)
    if not has_own_proc:
        sees.append(PROCESSES)
    if not _leave_network():
        sees.append(NETWORK)
    libc.unshare(CLONE_NEWIPC)
    _drop_capabilities()
    # Without a private tree, an older Landlock does not keep a program from emptying the user's files.
    truncates = bool(descriptors) or _landlock_version() >= SINCE_TRUNCATE
    if not _filter_system_calls(kills_all=has_pid_namespace, truncates=truncates):
        sees.append(SYSTEM_CALLS)
    return sees, why, descriptors


def hide_from_children() -> None:
    """Deny the children of this process, which run as the same user, access to its memory and descriptors."""
    _prctl(PR_SET_DUMPABLE, 0)


# The mount tree


def _enter_mount_tree(plan: dict[str, object], *, has_pid_namespace: bool) -> tuple[bool, list[int]]:
    """Build a mount tree below the home, and make it the root. An error leaves all mounts unchanged. Raises OSError.

    Returns whether /proc shows only processes of the namespace, and the descriptors of the private file systems.
    """
    if not has_pid_namespace:
        raise OSError(errno.EPERM, "no process namespace")
    if libc.unshare(CLONE_NEWNS):
        raise _last_error("unshare")
    _mount(None, "/", None, MS_REC | MS_PRIVATE)
    home = str(plan["home"])
    given = os.open(home, os.O_RDONLY | os.O_DIRECTORY)
    _mount("tmpfs", home, "tmpfs", MS_NOSUID | MS_NODEV, f"mode=0755,size={ROOT_SIZE}")
    try:
        tree = _Tree(home)
        tree.build(plan, given)
        descriptors = tree.descriptors(home)
        old = home + "/.old"
        os.mkdir(old)
        tree.lock()
        if libc.pivot_root(os.fsencode(home), os.fsencode(old)):
            raise _last_error("pivot_root")
    except OSError:
        libc.umount2(os.fsencode(home), MNT_DETACH)
        raise
    finally:
        os.close(given)
    os.chdir("/")
    if libc.umount2(b"/.old", MNT_DETACH):
        raise SystemExit("the old root cannot be left")
    os.rmdir("/.old")
    _mount(None, "/", None, MS_REMOUNT | MS_BIND | MS_RDONLY | MS_NOSUID | MS_NODEV)
    os.chdir(home)
    return tree.has_own_proc, descriptors


class _Tree:
    """A mount tree that is being built. `root` becomes /, and the mounts in `writable` are not made read-only."""

    def __init__(self, root: str) -> None:
        self.root = root
        self.writable = [root + "/tmp", root + "/dev/shm"]
        self.readable: dict[str, bool] = {}  # for each path: whether everything below it is readable, or hidden
        self.has_own_proc = True

    def build(self, plan: dict[str, object], given: int) -> None:
        """Mount everything that an estimator may see. `given` is the descriptor of the folder with its input."""
        home = str(plan["home"])
        self._mount_writable(int(plan["disk_bytes"]), int(plan["memory_bytes"]))  # type: ignore[call-overload]
        self._mount_proc()
        self._bind_devices(bool(plan["graphics"]))
        read = [(path, True) for path in (*SYSTEM, *SETTINGS, *PROCESSORS, *plan["read"])]  # type: ignore[misc]
        hidden = [(path, False) for path in plan["hidden"]]  # type: ignore[attr-defined]
        # By depth, so that a readable folder can be inside of a hidden one and vice versa.
        for path, is_read in sorted([*read, *hidden], key=lambda entry: (entry[0].count("/"), entry[1])):
            if is_read:
                self._read(path)
            else:
                self._hide(path)
        self._make_home(home, str(plan["homes"]))
        for name in os.listdir(given):
            self._bind(f"/proc/self/fd/{given}/{name}", f"{home}/{name}")

    def _mount_writable(self, disk_bytes: int, memory_bytes: int) -> None:
        """Mount the file system of the home and shared memory. The kernel removes both with the namespace."""
        for path, size, inodes in (("/tmp", disk_bytes, disk_bytes // INODE_BYTES), ("/dev/shm", memory_bytes, 65536)):
            os.makedirs(self.root + path)
            limits = f"mode=0755,size={size},nr_inodes={inodes}"
            _mount("tmpfs", self.root + path, "tmpfs", MS_NOSUID | MS_NODEV, limits)

    def _mount_proc(self) -> None:
        """Mount a read-only /proc that shows only the processes of the namespace.

        The kernel may refuse this in a container that hides parts of /proc. The system's /proc is bound then.
        """
        os.mkdir(self.root + "/proc")
        try:
            _mount("proc", self.root + "/proc", "proc", MS_RDONLY | MS_NOSUID | MS_NODEV | MS_NOEXEC)
        except OSError:
            self.has_own_proc = False
            self._bind("/proc", "/proc")
            return
        for name in MASKED:
            place = f"{self.root}/proc/{name}"
            if os.path.exists(place):
                _mount("/dev/null", place, None, MS_BIND)

    def _bind_devices(self, has_graphics: bool) -> None:
        devices = list(DEVICES)
        if has_graphics:
            devices += GRAPHICS
            devices += [f"/dev/{name}" for name in os.listdir("/dev") if name.startswith(GRAPHICS_PREFIX)]
        for path in devices:
            if os.path.exists(path):
                self._bind(path, path)
        for link, target in LINKS_OF_DEV:
            os.symlink(target, self.root + link)
        if has_graphics:  # drivers look up their devices in /sys
            self._bind("/sys", "/sys")

    def _read(self, path: str) -> None:
        """Make a file or folder readable, by the given path and by its real path."""
        real = os.path.realpath(path)
        if not os.path.exists(real):
            return
        if not self._is_readable(real):
            self._bind(real, real)
        if path != real and not os.path.lexists(self.root + path):
            self._link(path, real)

    def _link(self, path: str, real: str) -> None:
        """Create a symbolic link from a path to its real path, which is readable already."""
        place = self.root + path
        os.makedirs(os.path.dirname(place), exist_ok=True)
        os.symlink(os.path.relpath(real, os.path.dirname(path)), place)

    def _is_readable(self, real: str) -> bool:
        """Whether a path is in a readable folder, and not in a hidden folder inside of it."""
        place = real
        while place not in self.readable and place != "/":
            place = os.path.dirname(place)
        return self.readable.get(place, False)

    def _bind(self, source: str, path: str) -> None:
        target = self.root + path
        if os.path.isdir(source):
            os.makedirs(target, exist_ok=True)
        elif not os.path.exists(target):
            os.makedirs(os.path.dirname(target), exist_ok=True)
            os.close(os.open(target, os.O_CREAT | os.O_WRONLY | os.O_CLOEXEC, 0o644))
        _mount(source, target, None, MS_BIND | MS_REC)
        self.readable[path] = True

    def _hide(self, path: str) -> None:
        """Cover a file or folder inside of a readable folder by an empty one."""
        target = self.root + path
        if not self._is_readable(path) or not os.path.lexists(target):
            return
        if os.path.isdir(target):
            _mount("tmpfs", target, "tmpfs", MS_NOSUID | MS_NODEV, "mode=0755,size=4k")
        else:
            _mount("/dev/null", target, None, MS_BIND)
        self.readable[path] = False

    def _make_home(self, home: str, homes: str) -> None:
        """Create the home as an empty folder of the writable file system. The homes of other estimators are hidden."""
        place = self.root + home
        if self._is_readable(homes):
            os.mkdir(self.root + "/tmp/.homes")
            self._bind(self.root + "/tmp/.homes", homes)
            self.writable.append(self.root + homes)
        os.makedirs(place)
        if os.stat(place).st_dev != os.stat(self.root + "/tmp").st_dev:
            os.mkdir(self.root + "/tmp/.home")
            _mount(self.root + "/tmp/.home", place, None, MS_BIND)
            self.writable.append(place)

    def descriptors(self, home: str) -> list[int]:
        """The descriptors of the writable file system, of the home in it, and of shared memory."""
        flags = os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC
        return [os.open(self.root + path, flags) for path in ("/tmp", home, "/dev/shm")]

    def lock(self) -> None:
        """Make all mounts read-only except `writable`, including the mounts inside of bound folders."""
        with open("/proc/self/mountinfo", errors="surrogateescape") as file:
            mounts = [line.split(" ")[4:6] for line in file]
        for escaped, options in mounts:
            point = _unescaped(escaped)
            if not point.startswith(self.root + "/"):
                continue
            if point in self.writable:
                continue
            flags = MS_REMOUNT | MS_BIND | MS_RDONLY | MS_NOSUID
            if not point.startswith(self.root + "/dev/"):  # devices work only below /dev
                flags |= MS_NODEV
            if "noexec" in options.split(","):
                flags |= MS_NOEXEC
            try:
                _mount(None, point, None, flags)
            except OSError as error:
                # The mount is covered by another one, so it cannot be reached.
                if error.errno not in (errno.EINVAL, errno.ENOENT):
                    raise


def _unescaped(text: str) -> str:
    """A path of mountinfo without escapes. A blank, for example, is escaped as a backslash and 040."""
    first, *escaped = text.split("\\")
    plain = first
    for part in escaped:
        octal_code = part[:3]
        plain += chr(int(octal_code, 8)) + part[3:]
    return plain


def _mount(source: str | None, target: str, kind: str | None, flags: int, data: str | None = None) -> None:
    """Call mount(2). Raises OSError with the target."""
    words = [None if word is None else os.fsencode(word) for word in (source, target, kind)]
    if libc.mount(*words, ctypes.c_ulong(flags), None if data is None else data.encode()):
        raise _last_error(f"mount {target}")


def _last_error(what: str) -> OSError:
    number = ctypes.get_errno()
    return OSError(number, f"{what}: {os.strerror(number)}")


# Restricts files by landlock(7), if mounts are not allowed

LANDLOCK_CREATE_RULESET = 444
LANDLOCK_ADD_RULE = 445
LANDLOCK_RESTRICT_SELF = 446
LANDLOCK_VERSION_ASKED = 1
LANDLOCK_RULE_PATH_BENEATH = 1
# linux/landlock.h: the bits of access rights. Each version adds rights to those of the version before.
EXECUTE_READ_LIST = 0b1101
LIST = 0b1000
READ_WRITE = 0b110
EXECUTE_READ = 0b101
BITS_OF_VERSION = {1: 13, 2: 14, 3: 15, 4: 15}
BITS_SINCE_5 = 16
IOCTL_BIT = 1 << 15
ABSTRACT_SOCKETS_AND_SIGNALS = 0b11
SINCE_TRUNCATE = 3
SINCE_NETWORK = 4
SINCE_SCOPES = 6


def _restrict_files(plan: dict[str, object]) -> bool:
    """Allow this process only the files of the plan, and return whether that succeeds.

    It uses landlock(7), which needs no namespace.
    """
    version = _landlock_version()
    if version < 1:
        return False
    every_access = (1 << BITS_OF_VERSION.get(version, BITS_SINCE_5)) - 1
    ruleset = _new_ruleset(version, every_access)
    if ruleset < 0:
        return False
    for path, access in _access_rules(plan, every_access):
        _allow(ruleset, path, access & every_access)
    failed = libc.syscall(ctypes.c_long(LANDLOCK_RESTRICT_SELF), ctypes.c_int(ruleset), 0)
    os.close(ruleset)
    return bool(failed == 0)


def _landlock_version() -> int:
    """The version of Landlock that the kernel supports; negative if none."""
    number = ctypes.c_long(LANDLOCK_CREATE_RULESET)
    return int(libc.syscall(number, None, ctypes.c_size_t(0), LANDLOCK_VERSION_ASKED))


def _new_ruleset(version: int, every_access: int) -> int:
    """The descriptor of a ruleset that denies every access; negative if the kernel refuses it."""
    scopes = ABSTRACT_SOCKETS_AND_SIGNALS if version >= SINCE_SCOPES else 0
    attributes = struct.pack("QQQ", every_access, 0, scopes)
    size = 8  # the field for files; newer versions have one more field for the network, and one for scopes
    if version >= SINCE_NETWORK:
        size += 8
    if version >= SINCE_SCOPES:
        size += 8
    ruleset = libc.syscall(ctypes.c_long(LANDLOCK_CREATE_RULESET), attributes, ctypes.c_size_t(size), 0)
    return int(ruleset)


def _access_rules(plan: dict[str, object], every_access: int) -> list[tuple[str, int]]:
    """The paths that the process may use, each with its rights."""
    readable = [os.path.realpath(path) for path in (*SYSTEM, *SETTINGS, *PROCESSORS, *plan["read"])]  # type: ignore[misc]
    hidden = [str(path) for path in plan["hidden"]]  # type: ignore[attr-defined]
    rules = [("/proc", EXECUTE_READ_LIST)]
    for path in readable:
        rules += _rules_around(path, [place for place in hidden if place != path])
    # Python lists the folder that contains a package. If vobench is a clone, that folder is not in `readable`.
    package = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    rules.append((os.path.dirname(package), LIST))
    graphics = [f"/dev/{name}" for name in os.listdir("/dev") if GRAPHICS_PREFIX in name]
    rules += [(path, READ_WRITE | IOCTL_BIT) for path in (*DEVICES, *GRAPHICS, *graphics)]
    rules += [(str(plan["home"]), every_access), ("/dev/shm", every_access)]
    return rules


def _rules_around(path: str, hidden: list[str]) -> list[tuple[str, int]]:
    """The rights to read a file or folder except the hidden paths in it, whose names can still be listed.

    A rule holds for everything below a folder. If a hidden path is in it, its other entries get one rule each.
    """
    inside = [place for place in hidden if f"{place}/".startswith(f"{path}/")]
    if path in inside:
        return []
    if not inside:
        return [(path, EXECUTE_READ_LIST)]
    rules = [(path, LIST)]
    for name in _names(path):
        entry = os.path.join(path, name)
        if not os.path.islink(entry):  # a rule would hold for its target
            rules += _rules_around(entry, inside)
    return rules


def _names(folder: str) -> list[str]:
    """The names in a folder; none if it cannot be listed."""
    try:
        return os.listdir(folder)
    except OSError:
        return []


def _allow(ruleset: int, path: str, access: int) -> None:
    """Allow access to a file or folder if it exists. Everything without a rule is denied."""
    try:
        place = os.open(path, os.O_PATH | os.O_CLOEXEC)
    except OSError:
        return
    if not os.path.isdir(path):
        access &= EXECUTE_READ | READ_WRITE | IOCTL_BIT
    rule = struct.pack("=Qi", access, place)
    libc.syscall(ctypes.c_long(LANDLOCK_ADD_RULE), ctypes.c_int(ruleset), LANDLOCK_RULE_PATH_BENEATH, rule, 0)
    os.close(place)


# The network and privileges


def _leave_network() -> bool:
    """Move this process to a new network namespace with only the loopback device, and return whether that succeeds."""
    if libc.unshare(CLONE_NEWNET):
        return False
    try:
        import _socket
        import fcntl

        device = _socket.socket(_socket.AF_INET, _socket.SOCK_DGRAM)
        is_up_and_running = 0x1 | 0x40
        request_to_set_flags = 0x8914  # linux/sockios.h
        fcntl.ioctl(device.fileno(), request_to_set_flags, struct.pack("16sh14x", b"lo", is_up_and_running))
        device.close()
    except OSError:  # 127.0.0.1 cannot be reached either, which is acceptable
        pass
    return True


def _drop_capabilities() -> None:
    """Give up all capabilities of root, or of the first process of a user namespace, irrevocably."""
    for capability in range(MOST_CAPABILITIES):
        _prctl(PR_CAPBSET_DROP, capability)
    _prctl(PR_CAP_AMBIENT, PR_CAP_AMBIENT_CLEAR_ALL)
    header = struct.pack("Ii", CAPABILITY_VERSION, 0)
    none_of_them = bytes(24)
    libc.capset(header, none_of_them)


def _prctl(option: int, value: int) -> bool:
    zero = ctypes.c_ulong(0)
    return bool(libc.prctl(option, ctypes.c_ulong(value), zero, zero, zero) == 0)


# System calls

# The number of each refused system call on x86-64 and on arm64; -1 if there is none.
REFUSED = {
    "acct": (163, 89),
    "add_key": (248, 217),
    "adjtimex": (159, 171),
    "bpf": (321, 280),
    "chroot": (161, 51),
    "clock_adjtime": (305, 266),
    "clock_settime": (227, 112),
    "delete_module": (176, 106),
    "fanotify_init": (300, 262),
    "finit_module": (313, 273),
    "fsconfig": (431, 431),
    "fsmount": (432, 432),
    "fsopen": (430, 430),
    "fspick": (433, 433),
    "init_module": (175, 105),
    "io_uring_enter": (426, 426),
    "io_uring_register": (427, 427),
    "io_uring_setup": (425, 425),
    "ioperm": (173, -1),
    "iopl": (172, -1),
    "kcmp": (312, 272),
    "kexec_file_load": (320, 294),
    "kexec_load": (246, 104),
    "keyctl": (250, 219),
    "lookup_dcookie": (212, 18),
    "mount": (165, 40),
    "mount_setattr": (442, 442),
    "move_mount": (429, 429),
    "name_to_handle_at": (303, 264),
    "open_by_handle_at": (304, 265),
    "open_tree": (428, 428),
    "open_tree_attr": (467, 467),
    "perf_event_open": (298, 241),
    "pidfd_getfd": (438, 438),
    "pivot_root": (155, 41),
    "process_madvise": (440, 440),
    "process_vm_readv": (310, 270),
    "process_vm_writev": (311, 271),
    "ptrace": (101, 117),
    "quotactl": (179, 60),
    "quotactl_fd": (443, 443),
    "reboot": (169, 142),
    "request_key": (249, 218),
    "setdomainname": (171, 162),
    "sethostname": (170, 161),
    "setns": (308, 268),
    "settimeofday": (164, 170),
    "swapoff": (168, 225),
    "swapon": (167, 224),
    "syslog": (103, 116),
    "umount2": (166, 39),
    "unshare": (272, 97),
    "userfaultfd": (323, 282),
    "vhangup": (153, 58),
}
CLONE = (56, 220)
CLONE3 = (435, 435)
SOCKET = (41, 198)
IOCTL = (16, 29)
KILL = (62, 129)
FALLOCATE = (285, 47)
# System V memory, messages and semaphores outlive their process and count as nobody's, so that no limit holds for them.
# Neither does one hold for the pages that vmsplice lends to a pipe, and for files in memory without a name: a
# descriptor that is in flight from one process to another is nobody's.
UNCOUNTED = {
    "memfd_create": (319, 279),
    "memfd_secret": (447, 447),
    "msgget": (68, 186),
    "semget": (64, 190),
    "shmget": (29, 194),
    "vmsplice": (278, 75),
}
# Larger buffers of sockets count as nobody's, too. Requests for them have no effect.
SETSOCKOPT = (54, 208)
SOL_SOCKET = 1
BUFFER_SIZES = (7, 8, 32, 33)  # SO_SNDBUF, SO_RCVBUF, SO_SNDBUFFORCE, SO_RCVBUFFORCE
# Calls that can empty a file which the program may not write. A filter cannot check the flags of openat2.
TRUNCATE = (76, 45)
OPEN = (2, -1)
OPENAT = (257, 56)
OPENAT2 = (437, 437)
FALLOC_FL_KEEP_SIZE = 1  # linux/falloc.h
FALLOC_FL_PUNCH_HOLE = 2
SECCOMP = (317, 277)
FAMILIES = (1, 2, 10, 16)  # AF_UNIX, AF_INET, AF_INET6, AF_NETLINK
# linux/falloc.h: three ioctls that reserve disk space beyond the end of a file, as fallocate(2) does.
RESERVES = (0x40305828, 0x4030582A, 0x40305839)  # FS_IOC_RESVSP, FS_IOC_RESVSP64, FS_IOC_ZERO_RANGE
TYPES_INTO_TERMINAL = (0x5412, 0x541C)  # TIOCSTI, TIOCLINUX
MACHINES = {"x86_64": (0, 0xC000003E), "aarch64": (1, 0xC00000B7)}  # column of the numbers above, linux/audit.h
X32_BIT = 0x40000000
# linux/bpf_common.h, linux/seccomp.h: offsets of struct seccomp_data, little-endian
LOAD = 0x20
JUMP_IF_EQUAL = 0x15
JUMP_IF_AT_LEAST = 0x35
JUMP_IF_ANY_BIT = 0x45
RETURN = 0x06
NUMBER = 0
ARCHITECTURE = 4
FIRST_ARGUMENT = 16
SECOND_ARGUMENT = 24
THIRD_ARGUMENT = 32
ALLOW = 0x7FFF0000
FAIL = 0x00050000
SECCOMP_SET_MODE_FILTER = 1
SECCOMP_FILTER_FLAG_SPEC_ALLOW = 4  # without it, older kernels slow down the whole process
SECCOMP_MODE_FILTER = 2

Instruction = tuple[int, int, int, int]  # code, number of instructions to skip if true and if false, operand


def system_call_filter(machine: str, *, kills_all: bool, truncates: bool = True) -> list[Instruction]:
    """The seccomp filter for a machine, which is `x86_64` or `aarch64`.

    `kills_all` allows a signal to all visible processes at once. Without `truncates`, a file can be emptied only by a
    program that opens it for writing.
    """
    column, architecture = MACHINES[machine]
    fails = FAIL | errno.EPERM
    program: list[Instruction] = [
        (LOAD, 0, 0, ARCHITECTURE),
        (JUMP_IF_EQUAL, 1, 0, architecture),
        (RETURN, 0, 0, fails),
        (LOAD, 0, 0, NUMBER),
    ]
    if machine == "x86_64":
        program += [(JUMP_IF_AT_LEAST, 0, 1, X32_BIT), (RETURN, 0, 0, fails)]
    for numbers in REFUSED.values():
        if numbers[column] >= 0:
            program += [(JUMP_IF_EQUAL, 0, 1, numbers[column]), (RETURN, 0, 0, fails)]
    # Libraries fall back to clone, whose flags a filter can check, unlike those of clone3.
    program += [(JUMP_IF_EQUAL, 0, 1, CLONE3[column]), (RETURN, 0, 0, FAIL | errno.ENOSYS)]
    for numbers in UNCOUNTED.values():
        program += [(JUMP_IF_EQUAL, 0, 1, numbers[column]), (RETURN, 0, 0, FAIL | errno.ENOSYS)]
    # Space beyond the end of a file is exempt from the limit of file sizes. The log is on the user's disk.
    beyond_end = [
        (JUMP_IF_ANY_BIT, 2, 0, FALLOC_FL_PUNCH_HOLE),
        (JUMP_IF_ANY_BIT, 0, 1, FALLOC_FL_KEEP_SIZE),
        (RETURN, 0, 0, FAIL | errno.EOPNOTSUPP),
    ]
    program += _of_call(FALLOCATE[column], SECOND_ARGUMENT, beyond_end)
    new_namespace = [(JUMP_IF_ANY_BIT, 0, 1, CLONE_ANY_NEW & ~0xFF), (RETURN, 0, 0, fails)]
    program += _of_call(CLONE[column], FIRST_ARGUMENT, new_namespace)
    family = [(JUMP_IF_EQUAL, len(FAMILIES) - place, 0, known) for place, known in enumerate(FAMILIES)]
    program += _of_call(SOCKET[column], FIRST_ARGUMENT, [*family, (RETURN, 0, 0, FAIL | errno.EAFNOSUPPORT)])
    program += _ignored_buffer_sizes(SETSOCKOPT[column])
    refused_requests: list[Instruction] = []
    for request in (*TYPES_INTO_TERMINAL, *RESERVES):
        refused_requests += [(JUMP_IF_EQUAL, 0, 1, request), (RETURN, 0, 0, fails)]
    program += _of_call(IOCTL[column], SECOND_ARGUMENT, refused_requests)
    if not kills_all:
        everybody = [(JUMP_IF_EQUAL, 0, 1, 0xFFFFFFFF), (RETURN, 0, 0, fails)]
        program += _of_call(KILL[column], FIRST_ARGUMENT, everybody)
    if not truncates:
        program += _refused_truncation(column, fails)
    return [*program, (RETURN, 0, 0, ALLOW)]


def _ignored_buffer_sizes(number: int) -> list[Instruction]:
    """Instructions that let setsockopt succeed without an effect if it would change the size of a buffer."""
    options = [(JUMP_IF_EQUAL, len(BUFFER_SIZES) - place, 0, size) for place, size in enumerate(BUFFER_SIZES)]
    body: list[Instruction] = [
        (JUMP_IF_EQUAL, 0, len(options) + 3, SOL_SOCKET),
        (LOAD, 0, 0, THIRD_ARGUMENT),
        *options,
        (RETURN, 0, 0, ALLOW),
        (RETURN, 0, 0, FAIL),
    ]
    return _of_call(number, SECOND_ARGUMENT, body)


def _refused_truncation(column: int, fails: int) -> list[Instruction]:
    """Instructions that refuse to empty a file by its path, or by opening it without writing."""
    program: list[Instruction] = [(JUMP_IF_EQUAL, 0, 1, TRUNCATE[column]), (RETURN, 0, 0, fails)]
    program += [(JUMP_IF_EQUAL, 0, 1, OPENAT2[column]), (RETURN, 0, 0, FAIL | errno.ENOSYS)]
    # Landlock checks reading and writing. A file can also be opened for neither, with both bits of the mode set.
    empties_without_writing: list[Instruction] = [
        (JUMP_IF_ANY_BIT, 0, 4, os.O_TRUNC),
        (JUMP_IF_ANY_BIT, 1, 0, os.O_WRONLY),
        (JUMP_IF_ANY_BIT, 2, 1, os.O_RDWR),
        (JUMP_IF_ANY_BIT, 0, 1, os.O_RDWR),
        (RETURN, 0, 0, fails),
    ]
    for number, flags in ((OPEN[column], SECOND_ARGUMENT), (OPENAT[column], THIRD_ARGUMENT)):
        if number >= 0:
            program += _of_call(number, flags, empties_without_writing)
    return program


def _of_call(number: int, argument: int, body: list[Instruction]) -> list[Instruction]:
    """Instructions that check an argument of one system call and allow it at their end. Other calls skip them."""
    return [(JUMP_IF_EQUAL, 0, len(body) + 2, number), (LOAD, 0, 0, argument), *body, (RETURN, 0, 0, ALLOW)]


def _filter_system_calls(*, kills_all: bool, truncates: bool) -> bool:
    """Install the filter of system calls, and return whether that succeeds."""
    machine = os.uname().machine
    if machine not in MACHINES:
        return False
    program = system_call_filter(machine, kills_all=kills_all, truncates=truncates)
    code = b"".join(struct.pack("HBBI", *instruction) for instruction in program)
    buffer = ctypes.create_string_buffer(code, len(code))
    whole = struct.pack("HxxxxxxQ", len(program), ctypes.addressof(buffer))
    number = SECCOMP[MACHINES[machine][0]]
    flags = ctypes.c_ulong(SECCOMP_FILTER_FLAG_SPEC_ALLOW)
    if libc.syscall(ctypes.c_long(number), ctypes.c_ulong(SECCOMP_SET_MODE_FILTER), flags, whole) == 0:
        return True
    return bool(libc.prctl(PR_SET_SECCOMP, ctypes.c_ulong(SECCOMP_MODE_FILTER), whole) == 0)

"""The filter of system calls, checked by an interpreter of seccomp programs against the numbers of the kernel."""

import errno
import os
import subprocess
import sys

import pytest

from vobench.estimator import isolation
from vobench.estimator.isolation import ALLOW, FAIL, Instruction, system_call_filter

AUDIT_ARCHITECTURE = {"x86_64": 0xC000003E, "aarch64": 0xC00000B7}  # linux/audit.h
# Numbers of system calls: arch/x86/entry/syscalls/syscall_64.tbl and include/uapi/asm-generic/unistd.h.
OTHERS_X86_64 = {
    "read": 0,
    "ioctl": 16,
    "socket": 41,
    "fallocate": 285,
    "msgget": 68,
    "semget": 64,
    "shmget": 29,
    "vmsplice": 278,
    "memfd_create": 319,
    "memfd_secret": 447,
    "setsockopt": 54,
    "truncate": 76,
    "ftruncate": 77,
    "open": 2,
    "openat": 257,
    "openat2": 437,
    "clone": 56,
    "kill": 62,
    "clone3": 435,
    "seccomp": 317,
}
OTHERS_AARCH64 = {
    "read": 63,
    "ioctl": 29,
    "socket": 198,
    "fallocate": 47,
    "msgget": 186,
    "semget": 190,
    "shmget": 194,
    "vmsplice": 75,
    "memfd_create": 279,
    "memfd_secret": 447,
    "setsockopt": 208,
    "truncate": 45,
    "ftruncate": 46,
    "openat": 56,
    "openat2": 437,
    "clone": 220,
    "kill": 129,
    "clone3": 435,
    "seccomp": 277,
}
REFUSED_X86_64 = {
    "acct": 163,
    "add_key": 248,
    "adjtimex": 159,
    "bpf": 321,
    "chroot": 161,
    "clock_adjtime": 305,
    "clock_settime": 227,
    "delete_module": 176,
    "fanotify_init": 300,
    "finit_module": 313,
    "fsconfig": 431,
    "fsmount": 432,
    "fsopen": 430,
    "fspick": 433,
    "init_module": 175,
    "io_uring_enter": 426,
    "io_uring_register": 427,
    "io_uring_setup": 425,
    "ioperm": 173,
    "iopl": 172,
    "kcmp": 312,
    "kexec_file_load": 320,
    "kexec_load": 246,
    "keyctl": 250,
    "lookup_dcookie": 212,
    "mount": 165,
    "mount_setattr": 442,
    "move_mount": 429,
    "name_to_handle_at": 303,
    "open_by_handle_at": 304,
    "open_tree": 428,
    "open_tree_attr": 467,
    "perf_event_open": 298,
    "pidfd_getfd": 438,
    "pivot_root": 155,
    "process_madvise": 440,
    "process_vm_readv": 310,
    "process_vm_writev": 311,
    "ptrace": 101,
    "quotactl": 179,
    "quotactl_fd": 443,
    "reboot": 169,
    "request_key": 249,
    "setdomainname": 171,
    "sethostname": 170,
    "setns": 308,
    "settimeofday": 164,
    "swapoff": 168,
    "swapon": 167,
    "syslog": 103,
    "umount2": 166,
    "unshare": 272,
    "userfaultfd": 323,
    "vhangup": 153,
}
# There are no ports for input and output on arm64, so neither ioperm nor iopl.
REFUSED_AARCH64 = {
    "acct": 89,
    "add_key": 217,
    "adjtimex": 171,
    "bpf": 280,
    "chroot": 51,
    "clock_adjtime": 266,
    "clock_settime": 112,
    "delete_module": 106,
    "fanotify_init": 262,
    "finit_module": 273,
    "fsconfig": 431,
    "fsmount": 432,
    "fsopen": 430,
    "fspick": 433,
    "init_module": 105,
    "io_uring_enter": 426,
    "io_uring_register": 427,
    "io_uring_setup": 425,
    "kcmp": 272,
    "kexec_file_load": 294,
    "kexec_load": 104,
    "keyctl": 219,
    "lookup_dcookie": 18,
    "mount": 40,
    "mount_setattr": 442,
    "move_mount": 429,
    "name_to_handle_at": 264,
    "open_by_handle_at": 265,
    "open_tree": 428,
    "open_tree_attr": 467,
    "perf_event_open": 241,
    "pidfd_getfd": 438,
    "pivot_root": 41,
    "process_madvise": 440,
    "process_vm_readv": 270,
    "process_vm_writev": 271,
    "ptrace": 117,
    "quotactl": 60,
    "quotactl_fd": 443,
    "reboot": 142,
    "request_key": 218,
    "setdomainname": 162,
    "sethostname": 161,
    "setns": 268,
    "settimeofday": 170,
    "swapoff": 225,
    "swapon": 224,
    "syslog": 116,
    "umount2": 39,
    "unshare": 97,
    "userfaultfd": 282,
    "vhangup": 58,
}
REFUSED = {"x86_64": REFUSED_X86_64, "aarch64": REFUSED_AARCH64}
NUMBERS = {
    "x86_64": OTHERS_X86_64 | REFUSED_X86_64,
    "aarch64": OTHERS_AARCH64 | REFUSED_AARCH64,
}
LARGEST_NUMBER = 1024  # beyond all system calls of the kernel
EPERM = FAIL | errno.EPERM
CLONE_VM_AND_THREAD = 0x00010100
NEW_USER_NAMESPACE = 0x10000000
TIOCSTI = 0x5412
TCGETS = 0x5401
EVERY_PROCESS = 0xFFFFFFFF  # -1
machines = pytest.mark.parametrize("machine", ["x86_64", "aarch64"])


def verdict(program: list[Instruction], data: dict[int, int]) -> int:
    """The value that a program returns for a system call, whose data is given by offset (seccomp(2))."""
    accumulator = 0
    position = 0
    while True:
        code, if_true, if_false, operand = program[position]
        position += 1
        if code == 0x06:  # BPF_RET
            return operand
        if code == 0x20:  # BPF_LD | BPF_W | BPF_ABS
            accumulator = data.get(operand, 0)
            continue
        holds = {0x15: accumulator == operand, 0x35: accumulator >= operand, 0x45: bool(accumulator & operand)}[code]
        position += if_true if holds else if_false


def called(
    machine: str,
    name: str,
    first: int = 0,
    second: int = 0,
    third: int = 0,
    *,
    kills_all: bool = False,
    truncates: bool = True,
) -> int:
    """The verdict on a system call of a machine with its first three arguments."""
    program = system_call_filter(machine, kills_all=kills_all, truncates=truncates)
    data = {0: NUMBERS[machine][name], 4: AUDIT_ARCHITECTURE[machine], 16: first, 24: second, 32: third}
    return verdict(program, data)


@machines
def test_the_filter_is_installed_by_the_call_that_the_kernel_has_for_it(machine):
    column, _ = isolation.MACHINES[machine]
    assert isolation.SECCOMP[column] == NUMBERS[machine]["seccomp"]


@machines
@pytest.mark.parametrize("kills_all", [False, True])
def test_only_comparisons_skip_instructions(machine, kills_all):
    """As BPF_STMT of linux/filter.h writes all others, and none skips beyond the end."""
    program = system_call_filter(machine, kills_all=kills_all)
    for place, (code, if_true, if_false, _) in enumerate(program):
        if code in (0x15, 0x35, 0x45):
            assert place + 1 + max(if_true, if_false) < len(program)
        else:
            assert (if_true, if_false) == (0, 0)


@machines
def test_an_ordinary_call_is_allowed(machine):
    assert called(machine, "read") == ALLOW


@machines
def test_exactly_the_refused_calls_fail_whatever_their_arguments(machine):
    program = system_call_filter(machine, kills_all=False)
    refused = set()
    for number in range(LARGEST_NUMBER):
        data = {0: number, 4: AUDIT_ARCHITECTURE[machine]}
        if verdict(program, data) == EPERM:
            refused.add(number)
    assert refused == set(REFUSED[machine].values())


def test_both_machines_refuse_the_same_calls_except_for_the_ports_of_x86_64():
    assert REFUSED_X86_64.keys() == isolation.REFUSED.keys()
    assert REFUSED_X86_64.keys() - REFUSED_AARCH64.keys() == {"ioperm", "iopl"}


def test_calls_since_linux_5_1_have_one_number_on_all_machines():
    for name, number in REFUSED_AARCH64.items():
        assert number < 424 or REFUSED_X86_64[name] == number


@machines
def test_a_thread_may_be_started_but_no_namespace(machine):
    assert called(machine, "clone", CLONE_VM_AND_THREAD) == ALLOW
    assert called(machine, "clone", CLONE_VM_AND_THREAD | NEW_USER_NAMESPACE) == EPERM
    assert called(machine, "clone3") == FAIL | errno.ENOSYS


@machines
@pytest.mark.parametrize(
    ("family", "is_allowed"), [(1, True), (2, True), (10, True), (16, True), (17, False), (40, False)]
)
def test_only_common_families_of_sockets_are_allowed(machine, family, is_allowed):
    assert called(machine, "socket", family) == (ALLOW if is_allowed else FAIL | errno.EAFNOSUPPORT)


@machines
def test_nothing_can_be_typed_into_a_terminal(machine):
    assert called(machine, "ioctl", 0, TIOCSTI) == EPERM
    assert called(machine, "ioctl", 0, TCGETS) == ALLOW


@machines
@pytest.mark.parametrize("name", ["shmget", "msgget", "semget", "vmsplice", "memfd_create", "memfd_secret"])
def test_memory_that_counts_as_nobodys_is_not_to_be_had(machine, name):
    assert called(machine, name) == FAIL | errno.ENOSYS


KEEP_SIZE = 1
PUNCH_HOLE = 2


@machines
@pytest.mark.parametrize(
    ("mode", "is_allowed"), [(0, True), (KEEP_SIZE, False), (KEEP_SIZE | 0x10, False), (KEEP_SIZE | PUNCH_HOLE, True)]
)
def test_no_space_is_reserved_beyond_the_end_of_a_file(machine, mode, is_allowed):
    assert called(machine, "fallocate", 2, mode) == (ALLOW if is_allowed else FAIL | errno.EOPNOTSUPP)


@machines
def test_no_ioctl_reserves_space_beyond_the_end_of_a_file(machine):
    for request in (0x40305828, 0x4030582A, 0x40305839):  # FS_IOC_RESVSP, FS_IOC_RESVSP64, FS_IOC_ZERO_RANGE
        assert called(machine, "ioctl", 2, request) == EPERM


SOL_SOCKET = 1
IPPROTO_TCP = 6
SO_KEEPALIVE = 9


@machines
@pytest.mark.parametrize("option", [7, 8, 32, 33])  # SO_SNDBUF, SO_RCVBUF and the same by force
def test_a_request_for_larger_buffers_of_a_socket_succeeds_without_an_effect(machine, option):
    assert called(machine, "setsockopt", 3, SOL_SOCKET, option) == FAIL
    assert called(machine, "setsockopt", 3, IPPROTO_TCP, option) == ALLOW


@machines
def test_other_options_of_a_socket_can_be_set(machine):
    assert called(machine, "setsockopt", 3, SOL_SOCKET, SO_KEEPALIVE) == ALLOW


@machines
def test_of_other_layers_than_the_socket_every_option_can_be_set(machine):
    for level in set(range(64)) - {SOL_SOCKET}:
        assert called(machine, "setsockopt", 3, level, SO_KEEPALIVE) == ALLOW


@machines
@pytest.mark.parametrize(
    ("mode", "empties", "is_allowed"),
    [
        (os.O_RDONLY, False, True),
        (os.O_RDONLY, True, False),
        (os.O_WRONLY, False, True),
        (os.O_WRONLY, True, True),
        (os.O_RDWR, True, True),
        (os.O_WRONLY | os.O_RDWR, False, True),
        (os.O_WRONLY | os.O_RDWR, True, False),  # neither for reading nor for writing: open(2)
    ],
)
def test_where_landlock_does_not_keep_files_from_being_emptied_the_filter_does(machine, mode, empties, is_allowed):
    flags = os.O_CLOEXEC | mode | (os.O_TRUNC if empties else 0)
    expected = ALLOW if is_allowed else EPERM
    assert called(machine, "openat", 3, 0, flags, truncates=False) == expected
    assert called(machine, "openat", 3, 0, flags) == ALLOW
    if machine == "x86_64":
        assert called(machine, "open", 0, flags, truncates=False) == expected


@machines
def test_there_a_file_is_not_emptied_by_its_path_and_openat2_is_not_to_be_had(machine):
    assert called(machine, "truncate", truncates=False) == EPERM
    assert called(machine, "openat2", truncates=False) == FAIL | errno.ENOSYS
    assert called(machine, "ftruncate", truncates=False) == ALLOW
    assert called(machine, "truncate") == ALLOW


EMPTIES = """
import os, sys
from contextlib import suppress
from vobench.estimator import isolation
assert isolation._filter_system_calls(kills_all=False, truncates=False)
path = sys.argv[1]
for way in (lambda: os.truncate(path, 0), lambda: os.open(path, os.O_TRUNC), lambda: os.open(path, 3 | os.O_TRUNC)):
    with suppress(PermissionError): way()
    print(os.path.getsize(path))
open(path, "w").close()
print(os.path.getsize(path))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="seccomp is Linux's")
def test_the_kernel_agrees_on_what_empties_a_file(tmp_path):
    file = tmp_path / "truth"
    file.write_text("content")
    done = subprocess.run([sys.executable, "-c", EMPTIES, str(file)], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["7", "7", "7", "0"]


@machines
def test_a_signal_to_every_process_is_allowed_only_in_a_private_namespace(machine):
    assert called(machine, "kill", EVERY_PROCESS) == EPERM
    assert called(machine, "kill", EVERY_PROCESS, kills_all=True) == ALLOW
    assert called(machine, "kill", 1234) == ALLOW


@machines
def test_a_call_of_another_architecture_is_refused(machine):
    program = system_call_filter(machine, kills_all=False)
    assert verdict(program, {0: NUMBERS[machine]["read"], 4: 0x40000003}) == EPERM


def test_x32_calls_are_refused_on_x86_64():
    program = system_call_filter("x86_64", kills_all=False)
    x32_read = 0x40000000
    assert verdict(program, {0: x32_read, 4: AUDIT_ARCHITECTURE["x86_64"]}) == EPERM


@pytest.mark.skipif(sys.platform != "linux", reason="capabilities are those of Linux")
def test_a_process_that_is_not_the_first_of_a_namespace_loses_its_capabilities_as_well():
    code = (
        "from vobench.estimator import isolation\n"
        "isolation._drop_capabilities()\n"
        "print(open('/proc/self/status').read())\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    sets = {}
    for line in done.stdout.splitlines():
        name, _, value = line.partition(":")
        if name.startswith("Cap"):
            sets[name] = int(value, 16)
    assert len(sets) == 5
    if os.getuid() != 0:
        sets.pop("CapBnd")  # only root may reduce it
    assert set(sets.values()) == {0}


# LANDLOCK_ACCESS_FS_MAKE_SYM, _REFER, _TRUNCATE and _IOCTL_DEV of linux/landlock.h
@pytest.mark.parametrize(
    ("version", "newest_right"), [(1, 1 << 12), (2, 1 << 13), (3, 1 << 14), (4, 1 << 14), (5, 1 << 15), (7, 1 << 15)]
)
def test_every_right_that_a_version_of_landlock_knows_is_denied_and_no_other(monkeypatch, version, newest_right):
    denied = []

    def new_ruleset(_, every_access):
        denied.append(every_access)
        return -1

    monkeypatch.setattr(isolation, "_landlock_version", lambda: version)
    monkeypatch.setattr(isolation, "_new_ruleset", new_ruleset)
    assert not isolation._restrict_files({})
    assert denied == [newest_right | newest_right - 1]

"""The filter of system calls, checked by an interpreter of seccomp programs against the numbers of the kernel."""

import errno

import pytest

from vobench.estimator import isolation
from vobench.estimator.isolation import ALLOW, FAIL, Instruction, system_call_filter

AUDIT_ARCHITECTURE = {"x86_64": 0xC000003E, "aarch64": 0xC00000B7}  # linux/audit.h
# arch/x86/entry/syscalls/syscall_64.tbl and include/uapi/asm-generic/unistd.h
X86_64 = {
    "read": 0,
    "ioctl": 16,
    "socket": 41,
    "fallocate": 285,
    "msgget": 68,
    "shmget": 29,
    "clone": 56,
    "kill": 62,
    "clone3": 435,
    "add_key": 248,
    "bpf": 321,
    "chroot": 161,
    "delete_module": 176,
    "finit_module": 313,
    "init_module": 175,
    "fsmount": 432,
    "fsopen": 430,
    "keyctl": 250,
    "mount": 165,
    "pivot_root": 155,
    "setns": 308,
    "unshare": 272,
}
AARCH64 = {
    "read": 63,
    "ioctl": 29,
    "socket": 198,
    "fallocate": 47,
    "msgget": 186,
    "shmget": 194,
    "clone": 220,
    "kill": 129,
    "clone3": 435,
    "add_key": 217,
    "bpf": 280,
    "chroot": 51,
    "delete_module": 106,
    "finit_module": 273,
    "init_module": 105,
    "fsmount": 432,
    "fsopen": 430,
    "keyctl": 219,
    "mount": 40,
    "pivot_root": 41,
    "setns": 268,
    "unshare": 97,
}
NUMBERS = {"x86_64": X86_64, "aarch64": AARCH64}
REFUSED = sorted(X86_64.keys() & isolation.REFUSED.keys())
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


def called(machine: str, name: str, first: int = 0, second: int = 0, *, kills_all: bool = False) -> int:
    """The verdict on a system call of a machine with its first two arguments."""
    program = system_call_filter(machine, kills_all=kills_all)
    data = {0: NUMBERS[machine][name], 4: AUDIT_ARCHITECTURE[machine], 16: first, 24: second}
    return verdict(program, data)


@machines
def test_an_ordinary_call_is_allowed(machine):
    assert called(machine, "read") == ALLOW


@machines
@pytest.mark.parametrize("name", REFUSED)
def test_a_refused_call_is_refused_by_the_number_that_the_machine_gives_it(machine, name):
    assert called(machine, name) == EPERM


def test_the_refused_calls_include_modules_mounts_namespaces_and_keys():
    assert {"delete_module", "fsmount", "setns", "unshare", "keyctl", "chroot"} <= set(REFUSED)


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
@pytest.mark.parametrize("name", ["shmget", "msgget"])
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

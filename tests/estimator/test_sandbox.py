"""The sandbox against programs that look for the truth, for neighbours and for vobench itself, in six languages.

Whatever an attack gets at must be of a kind that the trial's record says it could see. Where the record is "full" that
is nothing. The file runs again as an ordinary user, and where the kernel gives no namespaces.
"""

import ctypes
import hashlib
import os
import shutil
import socket
import subprocess
import sys
import threading
import time
import uuid
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.elsewhere import RERUN, first_time, on_poorer_kernels, refusing, rerun, rerun_as_ordinary_user
from vobench.estimator import isolation
from vobench.estimator.home import Home
from vobench.estimator.isolation import FILES, NAMES, NETWORK, PROCESSES, SHARED_MEMORY, SYSTEM_CALLS
from vobench.estimator.manifest import Limits
from vobench.estimator.program import EstimatorFailure, Program, sandbox_here
from vobench.estimator.readable_folders import READ_VARIABLE, SWITCH_VARIABLE
from vobench.estimator.sandbox import Sandbox, from_guard_report

# ruff: noqa: E501 - one attack is one text

pytestmark = [pytest.mark.slow, pytest.mark.skipif(sys.platform != "linux", reason="the sandbox is Linux's")]

LIMITS = Limits(start_s=30, trial_s=60)
PREPARE = {
    "awk": "",
    "node": "",
    "python": "import ctypes, glob, os, socket, struct, sys, time\nfrom contextlib import suppress\nT = dict(word.split('=', 1) for word in sys.argv[1:])\nlibc = ctypes.CDLL(None, use_errno=True)\n",
    "sh": 'for word in "$@"; do eval "${word%%=*}=\\"\\${word#*=}\\""; done\n',
    "perl": "my %T = map { split(/=/, $_, 2) } @ARGV;\nsub show { my $f; open($f, '<', $_[0]) and print <$f>; }\n",
    "c": """
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mount.h>
#include <sys/ptrace.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <sys/wait.h>
#include <unistd.h>
static char **words; static int number;
static const char *T(const char *name) {
  for (int i = 1; i < number; ++i) if (!strncmp(words[i], name, strlen(name)) && words[i][strlen(name)] == '=') return words[i] + strlen(name) + 1;
  return "";
}
static void show(const char *path) {
  char text[4096]; int fd = open(path, O_RDONLY); if (fd < 0) return;
  int got = read(fd, text, sizeof text - 1); if (got > 0) { text[got] = 0; puts(text); }
  close(fd);
}
static void attack(void);
int main(int n, char **w) { number = n; words = w; attack(); fflush(stdout); return 0; }
""",
}


@dataclass(frozen=True, slots=True)
class Attack:
    """A program that prints what it gets hold of; `sees` is what it needs to see for that."""

    sees: str
    language: str
    code: str
    works_bare: bool = True  # it succeeds where there is no sandbox


ATTACKS = {
    "opens the truth": Attack(FILES, "python", "print(open(T['truth']).read())"),
    "opens the truth with sh": Attack(FILES, "sh", 'cat "$truth"'),
    "opens the truth with perl": Attack(FILES, "perl", "show($T{truth});"),
    "opens the truth in C": Attack(FILES, "c", 'static void attack(void) { show(T("truth")); }'),
    "searches earlier runs": Attack(FILES, "python", "for path in glob.glob(T['runs'] + '/**/*.tum', recursive=True): print(open(path).read())"),
    "searches earlier runs with find": Attack(FILES, "sh", 'find "$runs" -name ground_truth.tum -exec cat {} +'),
    "follows the link of an earlier run": Attack(FILES, "perl", "show($_) for glob(\"$T{runs}/*/*/cases/*/sequence/*\");"),
    "follows a link of its own folder": Attack(FILES, "python", "print(open(os.path.join(T['own'], 'link', 'truth.txt')).read())"),
    "reads what a neighbour works on": Attack(FILES, "python", "for path in glob.glob(T['neighbour_home'] + '/*'): print(open(path).read())"),
    "reads the user's keys": Attack(FILES, "sh", 'cat "$user/.ssh/id_ed25519"'),
    "goes through the root of other processes": Attack(FILES, "python", "for root in glob.glob('/proc/[0-9]*/root'):\n    with suppress(OSError): print(open(root + T['truth']).read())"),
    "goes through the working folder of a neighbour": Attack(PROCESSES, "python", "for cwd in glob.glob('/proc/[0-9]*/cwd'):\n    with suppress(OSError): print(open(cwd + '/truth.txt').read())"),
    "goes through open files of other processes": Attack(PROCESSES, "python", "for path in glob.glob('/proc/[0-9]*/fd/*'):\n    with suppress(OSError):\n        if os.readlink(path).endswith('truth.txt'): print(open(path).read())"),
    "reads the environment of other processes": Attack(PROCESSES, "sh", 'cat /proc/[0-9]*/environ 2>/dev/null | tr "\\0" "\\n"'),
    "reads the words of other processes": Attack(PROCESSES, "perl", "show($_) for glob('/proc/[0-9]*/cmdline');"),
    "reads the memory of vobench by /proc": Attack(PROCESSES, "python", "file = open(f\"/proc/{T['vobench']}/mem\", 'rb', 0)\nfile.seek(int(T['address']))\nprint(file.read(64))"),
    "reads the memory of vobench by process_vm_readv": Attack(PROCESSES, "c", """static void attack(void) {
  char text[65] = {0}; struct iovec here = {text, 64}, there = {(void *)strtoull(T("address"), 0, 10), 64};
  if (process_vm_readv(atoi(T("vobench")), &here, 1, &there, 1, 0) > 0) puts(text); }"""),
    "stops a neighbour with ptrace": Attack(PROCESSES, "c", """static void attack(void) {
  int pids[] = {atoi(T("neighbour")), atoi(T("vobench")), getppid(), 1};
  for (int i = 0; i < 4; ++i) { long word;
    if (ptrace(PTRACE_SEIZE, pids[i], 0, 0)) continue;
    ptrace(PTRACE_DETACH, pids[i], 0, 0); puts(getenv("HOME")); printf("%s%s", T("half"), T("other_half")); return; } }"""),
    "takes a descriptor of vobench": Attack(PROCESSES, "c", """static void attack(void) {
  int pid = syscall(434, atoi(T("neighbour")), 0);
  for (int fd = 0; fd < 64; ++fd) { int mine = syscall(438, pid, fd, 0); char path[64]; if (mine < 0) continue;
    sprintf(path, "/proc/self/fd/%d", mine); show(path); } }"""),
    "unmounts everything": Attack(FILES, "c", """static void attack(void) {
  char line[4096], point[4096]; FILE *mounts = fopen("/proc/self/mountinfo", "r");
  while (mounts && fgets(line, sizeof line, mounts)) if (sscanf(line, "%*s %*s %*s %*s %4095s", point) == 1 && strcmp(point, "/proc") && strcmp(point, "/")) umount2(point, MNT_DETACH);
  show(T("truth")); }""", works_bare=False),  # not tried: it would unmount ours
    "mounts the disk": Attack(FILES, "c", """static void attack(void) {
  char line[4096], kind[256], device[256]; FILE *mounts = fopen("/proc/self/mounts", "r");
  while (mounts && fgets(line, sizeof line, mounts)) if (sscanf(line, "%255s %*s %255s", device, kind) == 2) mount(device, "/tmp", kind, MS_RDONLY, 0);
  char path[4096]; sprintf(path, "/tmp%s", T("truth")); show(path); }""", works_bare=False),
    "mounts in a user namespace of its own": Attack(FILES, "python", """
uid, gid = os.getuid(), os.getgid()
print('unshared', libc.unshare(0x10000000 | 0x00020000))
with suppress(OSError):
    open('/proc/self/setgroups', 'w').write('deny'); open('/proc/self/uid_map', 'w').write(f'0 {uid} 1'); open('/proc/self/gid_map', 'w').write(f'0 {gid} 1')
for line in open('/proc/self/mountinfo').read().splitlines()[::-1]:
    libc.umount2(line.split()[4].encode(), 2)
with suppress(OSError): print(open(T['truth']).read())
""", works_bare=False),
    "clones into a user namespace": Attack(SYSTEM_CALLS, "c", """static void attack(void) {
  long flags[] = {CLONE_NEWUSER | SIGCHLD, CLONE_NEWNS | SIGCHLD, CLONE_NEWPID | SIGCHLD};
  for (int i = 0; i < 3; ++i) { long pid = syscall(SYS_clone, flags[i], 0, 0, 0, 0); if (pid == 0) _exit(0);
    if (pid > 0) { waitpid(pid, 0, 0); printf("%s%s", T("half"), T("other_half")); } }
  unsigned long long wide[11] = {CLONE_NEWUSER, 0, 0, 0, SIGCHLD};
  long pid = syscall(435, wide, sizeof wide); if (pid == 0) _exit(0);
  if (pid > 0) { waitpid(pid, 0, 0); printf("%s%s", T("half"), T("other_half")); } }""", works_bare=False),
    "leaves a chroot": Attack(FILES, "c", """static void attack(void) {
  mkdir("x", 0700); chroot("x"); for (int i = 0; i < 64; ++i) chdir(".."); chroot("."); show(T("truth")); }""", works_bare=False),
    "joins the namespaces of others": Attack(FILES, "python", """
for pid in (1, T['vobench'], T['neighbour'], os.getppid()):
    for kind in ('user', 'pid', 'mnt'):
        with suppress(OSError): libc.setns(os.open(f'/proc/{pid}/ns/{kind}', os.O_RDONLY), 0)
with suppress(OSError): print(open(T['truth']).read())
""", works_bare=False),
    "opens the disk's root by its handle": Attack(FILES, "c", """static void attack(void) {
  struct { unsigned bytes; int type; unsigned inode, generation; } handle = {8, 1, 2, 0};
  int places[] = {2, open(".", O_RDONLY), open("/usr", O_RDONLY)};
  for (int i = 0; i < 3; ++i) { int root = syscall(SYS_open_by_handle_at, places[i], &handle, O_RDONLY); if (root < 0) continue;
    fchdir(root); show(T("truth") + 1); } }""", works_bare=False),
    "makes a device of the disk": Attack(FILES, "perl", "for my $type ('b', 'c') { for my $minor (0 .. 3) { system('mknod', \"d$type$minor\", $type, 1, $minor); my $f; open($f, '<', \"d$type$minor\") or next; print $T{half}.$T{other_half}; } }", works_bare=False),
    "opens devices of memory, disks and the log": Attack(FILES, "sh", 'for d in /dev/mem /dev/kmem /dev/port /dev/kmsg /dev/vda /dev/sda /dev/nvme0n1 /dev/loop0 /proc/kcore /proc/kmsg; do head -c 1 "$d" 2>/dev/null | grep -q . && echo "$half$other_half $d"; done', works_bare=False),
    "has descriptors that it should not": Attack(FILES, "c", """static void attack(void) {
  for (int fd = 3; fd < 4096; ++fd) if (fcntl(fd, F_GETFD) >= 0) printf("%d %s%s", fd, T("half"), T("other_half")); }""", works_bare=False),
    "reads a socket of an abstract name": Attack(NETWORK, "python", "here = socket.socket(socket.AF_UNIX)\nhere.settimeout(2)\nhere.connect('\\0' + T['abstract'])\nprint(here.recv(100))"),
    "reads a port of 127.0.0.1": Attack(NETWORK, "perl", "use IO::Socket::INET; my $s = IO::Socket::INET->new(PeerAddr => '127.0.0.1', PeerPort => $T{port}, Timeout => 2); print <$s> if $s;"),
    "looks for other networks": Attack(NETWORK, "python", "names = [name for _, name in socket.if_nameindex()]\nprint(names)\nif set(names) - {'lo'} : print(T['half'] + T['other_half'])", works_bare=False),
    "speaks to the host of a virtual machine": Attack(SYSTEM_CALLS, "python", "for family in (40, 38, 17, 31):\n    with suppress(OSError): socket.socket(family, socket.SOCK_SEQPACKET if family == 38 else socket.SOCK_STREAM if family == 40 else socket.SOCK_RAW); print(T['half'] + T['other_half'])", works_bare=False),
    "reads shared memory by its name": Attack(SHARED_MEMORY, "sh", 'cat "/dev/shm/$shared"'),
    "reads shared memory of System V": Attack(SHARED_MEMORY, "c", """
#include <sys/shm.h>
static void attack(void) { char *at = shmat(atoi(T("segment")), 0, SHM_RDONLY); if (at != (void *)-1) puts(at); }"""),
    "reads the keyring": Attack(SYSTEM_CALLS, "c", """static void attack(void) { char text[100] = {0};
  if (syscall(SYS_keyctl, 11, atoi(T("key")), text, 99) > 0) puts(text); }""", works_bare=False),
    "watches the folder of temporary files": Attack(FILES, "python", """
watch = libc.inotify_init1(os.O_NONBLOCK)
for place in (T['temporary'], T['runs'], T['temporary'] + '/vobench-%d' % os.getuid()):
    if libc.inotify_add_watch(watch, place.encode(), 0xFFF) >= 0 and os.listdir(place): print(os.listdir(place))
if os.path.exists(T['runs']): print(T['half'] + T['other_half'])
"""),
    "has vobench's variables": Attack(PROCESSES, "sh", "env; set", works_bare=False),
    "asks a program with other rights": Attack(FILES, "sh", 'for tool in "su -c" "sudo -n sh -c" "pkexec sh -c" "unshare -Urm sh -c" "nsenter -t 1 -m sh -c"; do $tool "cat $truth" </dev/null 2>/dev/null; done', works_bare=False),
    "writes the pattern of core dumps": Attack(FILES, "sh", 'for f in core_pattern modprobe hotplug; do (cat /proc/sys/kernel/$f > kept && cat kept > /proc/sys/kernel/$f) 2>/dev/null && echo "$half$other_half $f"; done', works_bare=False),
    "loads a library into others": Attack(FILES, "sh", 'for f in /etc/ld.so.preload /etc/ld.so.cache /usr/lib/x.so /usr/local/lib/x.so; do (: >> "$f") 2>/dev/null && echo "$half$other_half $f"; done', works_bare=False),
    "climbs from its own root": Attack(FILES, "perl", "show(\"$_$T{truth}\") for ('/..', '/../../..', '/proc/self/root/..', '/proc/1/root', '/proc/1/cwd/../../..', '/proc/self/task/../../1/root');"),
    "holds memory of System V that nobody has attached": Attack(SYSTEM_CALLS, "c", """
#include <sys/shm.h>
#include <sys/msg.h>
#include <sys/sem.h>
static void attack(void) { if (shmget(IPC_PRIVATE, 4096, 0600 | IPC_CREAT) >= 0 || msgget(IPC_PRIVATE, 0600 | IPC_CREAT) >= 0 || semget(IPC_PRIVATE, 9, 0600 | IPC_CREAT) >= 0) printf("%s%s", T("half"), T("other_half")); }""", works_bare=False),
    "reserves disk space beyond the end of its log": Attack(SYSTEM_CALLS, "c", """
#include <sys/ioctl.h>
static void attack(void) { struct { short type, whence; long start, length; int more[6]; } space = {0, 0, 0, 1 << 22}; struct stat log;
  fallocate(2, 1, 0, 1 << 22); ioctl(2, 0x4030582A, &space); ioctl(2, 0x40305828, &space);
  fstat(2, &log); if (log.st_blocks > 4096) printf("%s%s", T("half"), T("other_half")); }""", works_bare=False),
    "reads the machine's tables in /proc": Attack(PROCESSES, "sh", 'for f in keys kpageflags vmallocinfo slabinfo timer_list iomem kcore; do head -c 1 /proc/$f 2>/dev/null | grep -q . && echo "$half$other_half $f"; done', works_bare=False),
    "opens the truth by openat2": Attack(FILES, "c", """static void attack(void) {
  unsigned long long how[3] = {O_RDONLY, 0, 0x10}; char path[4096]; sprintf(path, "/proc/self/root/../..%s", T("truth"));
  const char *names[] = {T("truth"), path}; int places[] = {AT_FDCWD, open("/", O_PATH), open(T("own"), O_PATH)};
  for (int i = 0; i < 6; ++i) { how[2] = i < 3 ? 0 : 0x10; int fd = syscall(437, places[i % 3], names[i & 1], how, sizeof how); if (fd < 0) continue;
    char at[64]; sprintf(at, "/proc/self/fd/%d", fd); show(at); } }"""),
    "goes from its log to the folder of the log": Attack(FILES, "python", "for place in ('/proc/self/fd/2/..', '/proc/self/fd/1/../..', os.path.dirname(os.readlink('/proc/self/fd/2'))):\n    with suppress(OSError):\n        if os.listdir(place): print(T['half'] + T['other_half'])", works_bare=False),
    "opens the truth by an io_uring": Attack(SYSTEM_CALLS, "c", """static void attack(void) {
  char parameters[120] = {0}; if (syscall(425, 4, parameters) >= 0) printf("%s%s", T("half"), T("other_half")); }""", works_bare=False),
    "maps the truth into memory": Attack(FILES, "python", "import mmap\nwith open(T['truth'], 'rb') as file: print(mmap.mmap(file.fileno(), 0, prot=mmap.PROT_READ)[:])"),
    "makes a link to the truth and reads that": Attack(FILES, "sh", 'ln -s "$truth" here; cat here; ln "$truth" there 2>/dev/null && cat there'),
    "opens the truth with awk": Attack(FILES, "awk", "END { while ((getline line < truth) > 0) print line }"),
    "opens the truth with JavaScript": Attack(FILES, "node", "const word = process.argv.find(word => word.startsWith('truth='));\nconsole.log(require('fs').readFileSync(word.slice(6), 'utf8'));"),
    "opens the truth by its handle": Attack(FILES, "c", """static void attack(void) {
  struct { unsigned bytes; int type; char rest[128]; } handle = {128, 0}; int mount;
  if (syscall(SYS_name_to_handle_at, AT_FDCWD, T("truth"), &handle, &mount, 0)) return;
  int fd = syscall(SYS_open_by_handle_at, open("/", O_RDONLY), &handle, O_RDONLY); if (fd < 0) return;
  char path[64]; sprintf(path, "/proc/self/fd/%d", fd); show(path); }""", works_bare=False),
    "opens performance counters, programs of the kernel and faults of others": Attack(SYSTEM_CALLS, "c", """static void attack(void) {
  char attributes[128] = {1, 0, 0, 0, 128}; int numbers[] = {SYS_perf_event_open, SYS_bpf, SYS_userfaultfd};
  for (int i = 0; i < 3; ++i) { int fd = i == 0 ? syscall(numbers[0], attributes, 0, -1, -1, 0) : i == 1 ? syscall(numbers[1], 0, attributes, 128) : syscall(numbers[2], 1);
    if (fd >= 0) printf("%d %s%s", i, T("half"), T("other_half")); } }""", works_bare=False),
    "watches whole file systems": Attack(SYSTEM_CALLS, "c", """static void attack(void) {
  if (syscall(SYS_fanotify_init, 0x200, O_RDONLY) >= 0) printf("%s%s", T("half"), T("other_half")); }""", works_bare=False),
    "guesses from the sizes of files in the store": Attack(NAMES, "python", "if os.stat(T['truth']).st_size: print(T['half'] + T['other_half'])"),
    "finds paths of the store in its variables": Attack(FILES, "sh", 'env | grep -F -e "$runs" -e "${truth%/*}" && echo "$half$other_half"', works_bare=False),
    "finds paths of the store in its mounts and maps": Attack(FILES, "sh", 'cat /proc/self/mountinfo /proc/self/mounts /proc/self/maps | grep -F -e "$runs" -e "${truth%/*}" && echo "$half$other_half"', works_bare=False),
    "goes through the mapped files of other processes": Attack(PROCESSES, "python", "for path in glob.glob('/proc/[0-9]*/map_files/*'):\n    with suppress(OSError):\n        if T['temporary'] in os.readlink(path): print(T['half'] + T['other_half'])", works_bare=False),
    "types into the terminal of the user": Attack(SYSTEM_CALLS, "perl", "for my $device ('/dev/tty', '/dev/console', '/dev/tty0', '/dev/pts/0') { my $f; open($f, '+<', $device) and ioctl($f, 0x5412, 'x') and print $T{half}.$T{other_half}; }", works_bare=False),
    "mounts in user space": Attack(FILES, "sh", '(: <> /dev/fuse) 2>/dev/null && echo "$half$other_half"', works_bare=False),
    "asks the services of the machine by their sockets": Attack(FILES, "perl", "use IO::Socket::UNIX; for my $path (glob('/run/*.sock /run/*/*.sock /run/*/*/*.sock /run/dbus/* /tmp/.X11-unix/*')) { IO::Socket::UNIX->new(Peer => $path) and print \"$path $T{half}$T{other_half}\"; }", works_bare=False),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class World:
    """What there is to be found: everything that can be read has the secret in it."""

    secret: str
    place: Path
    own: Path
    neighbour: subprocess.Popen[bytes]
    words: list[str]


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    """A store with truth, earlier runs, a user's files, a neighbour, and what vobench itself holds."""
    secret = f"truth{uuid.uuid4().hex}"
    place = tmp_path_factory.mktemp("world")
    own = place / "estimators" / "bad"
    for folder in ("store/sequences/a", "runs/suite/one/cases/case", "user/.ssh", "neighbour", "estimators/bad"):
        (place / folder).mkdir(parents=True)
    for file in (
        "store/sequences/a/truth.txt",
        "runs/suite/one/cases/case/ground_truth.tum",
        "user/.ssh/id_ed25519",
        "neighbour/poses.txt",
    ):
        (place / file).write_text(secret)
    truth = place / "store/sequences/a/truth.txt"
    (place / "runs/suite/one/cases/case/sequence").symlink_to(truth.parent)
    (own / "link").symlink_to(truth.parent)
    (own / "data.txt").write_text("own")
    shared = Path("/dev/shm") / f"vobench-test-{uuid.uuid4().hex}"
    shared.write_text(secret)
    libc = ctypes.CDLL(None, use_errno=True)
    libc.shmat.restype = ctypes.c_void_p
    segment = libc.shmget(0, 4096, 0o600 | 0o1000)
    ctypes.memmove(libc.shmat(segment, None, 0), secret.encode(), len(secret))
    memory = ctypes.create_string_buffer(secret.encode())
    abstract = f"vobench-test-{uuid.uuid4().hex}"
    servers = [socket.socket(socket.AF_UNIX), socket.socket(socket.AF_INET)]
    servers[0].bind(f"\0{abstract}")
    servers[1].bind(("127.0.0.1", 0))
    for server in servers:
        server.listen()
        threading.Thread(target=serve, args=(server, secret), daemon=True).start()
    with truth.open() as held:
        neighbour = subprocess.Popen(
            [sys.executable, "-c", "import time; time.sleep(1000)", secret],
            cwd=truth.parent,
            env={**os.environ, "SECRET": secret},
            pass_fds=[held.fileno()],
        )
    key = libc.syscall(
        isolation.REFUSED["add_key"][os.uname().machine == "aarch64"], b"user", b"vobench-test", secret.encode(), len(secret), -2
    )  # fmt: skip
    targets = {
        "truth": truth,
        "runs": place / "runs",
        "own": own,
        "user": place / "user",
        "neighbour_home": place / "neighbour",
        "vobench": os.getpid(),
        "neighbour": neighbour.pid,
        "address": ctypes.addressof(memory),
        "abstract": abstract,
        "port": servers[1].getsockname()[1],
        "shared": shared.name,
        "segment": segment,
        "key": key,
        "temporary": place,
        "half": secret[:20],
        "other_half": secret[20:],
    }
    yield World(secret, place, own, neighbour, [f"{name}={value}" for name, value in targets.items()])
    neighbour.kill()
    neighbour.wait()
    shared.unlink()
    libc.shmctl(segment, 0, None)
    for server in servers:
        server.close()


def serve(server, secret):
    with suppress(OSError):
        while True:
            client, _ = server.accept()
            with client, suppress(OSError):
                client.sendall(secret.encode() + b"\n")


@pytest.fixture
def run(world, tmp_path, monkeypatch):
    """Runs an attack in one of six languages; returns what it could see and what it printed."""
    monkeypatch.setenv("SECRET_TOKEN", world.secret)

    def run(language, code, *, limits=LIMITS, own=world.own):
        argv = [*command_of(language, code, own), *world.words]
        log = tmp_path / "log.txt"
        with Program(argv, log=log, limits=limits, folder=own, hidden=[world.place / "store"]) as program:
            with suppress(EstimatorFailure):
                program.wait()
            saw = program.sandbox
        return saw, log.read_text(errors="replace")

    return run


def command_of(language, code, own):
    """How a program in a language is started; one in C is compiled first, into the estimator's own folder."""
    source = PREPARE[language] + code
    if language == "python":
        return [sys.executable, "-I", "-S", "-c", source]
    tool = shutil.which({"sh": "sh", "perl": "perl", "c": "cc", "awk": "awk", "node": "node"}[language])
    if tool is None:
        pytest.skip(f"no {language} on this machine")
    if language == "sh":
        return [tool, "-c", source, "attack"]
    if language in ("perl", "node"):
        return [tool, "-e", source]
    if language == "awk":
        return [tool, source]
    program = own / f"program-{hashlib.sha256(source.encode()).hexdigest()[:12]}"
    if not program.exists():
        subprocess.run([tool, "-w", "-O0", "-x", "c", "-o", program, "-"], input=source.encode(), check=True)
    return [str(program)]


@pytest.mark.parametrize("attack", ATTACKS.values(), ids=ATTACKS)
def test_what_an_attack_gets_at_is_of_a_kind_that_the_record_names(run, world, attack):
    saw, printed = run(attack.language, attack.code)
    assert "cannot be started" not in printed
    if world.secret in printed:
        # By another process's links one comes to files, by files to other processes, and by files to their names.
        kinds = {attack.sees, FILES} if attack.sees in (PROCESSES, NAMES) else {attack.sees}
        assert kinds & set(saw.sees), (saw, printed[:500])
    assert world.neighbour.poll() is None


BARE = {name: attack for name, attack in ATTACKS.items() if attack.works_bare}


@pytest.mark.skipif(bool(os.environ.get(RERUN)), reason="as another user an attack may fail for other reasons")
@pytest.mark.parametrize("attack", BARE.values(), ids=BARE)
def test_an_attack_succeeds_where_there_is_no_sandbox_and_the_record_says_so(run, world, monkeypatch, attack):
    monkeypatch.setenv(SWITCH_VARIABLE, "off")
    saw, printed = run(attack.language, attack.code)
    assert saw.level == "none"
    assert saw.why == f"{SWITCH_VARIABLE}=off"
    if attack.sees in (FILES, PROCESSES, NETWORK):
        assert attack.sees in saw.sees
    assert world.secret in printed


def test_every_refused_system_call_is_refused(run):
    if SYSTEM_CALLS in sandbox_here().sees:
        pytest.skip("no filter of system calls on this machine")
    column = isolation.MACHINES[os.uname().machine][0]
    numbers = {name: both[column] for name, both in isolation.REFUSED.items() if both[column] >= 0}
    code = f"for name, number in {numbers}.items():\n    ctypes.set_errno(0)\n    print(name, libc.syscall(number, -1, 0, 0, 0, 0), ctypes.get_errno())"
    _, printed = run("python", code)
    assert [line.split()[1:] for line in printed.splitlines()] == [["-1", "1"]] * len(numbers)


def test_the_filter_has_the_numbers_of_this_machines_headers(run):
    if shutil.which("cc") is None:
        pytest.skip("no C compiler on this machine")
    column = isolation.MACHINES[os.uname().machine][0]
    names = [name for name, both in isolation.REFUSED.items() if both[column] >= 0]
    lines = "".join(f'#ifdef SYS_{name}\n printf("{name} %d\\n", SYS_{name});\n#endif\n' for name in names)
    _, printed = run("c", f"static void attack(void) {{\n{lines} }}")
    known = dict(line.split() for line in printed.splitlines())
    assert len(known) > 40
    assert {name: int(number) for name, number in known.items()} == {
        name: isolation.REFUSED[name][column] for name in known
    }


def test_it_has_no_privileges_and_gets_none(run):
    saw, printed = run("sh", "cat /proc/self/status")
    facts = dict(line.split(":", 1) for line in printed.splitlines() if ":" in line)
    for name in ("CapInh", "CapPrm", "CapEff", "CapAmb"):
        assert int(facts[name], 16) == 0
    assert facts["NoNewPrivs"].strip() == "1"
    if SYSTEM_CALLS not in saw.sees:
        assert facts["Seccomp"].strip() == "2"
    if os.getuid() == 0:
        assert int(facts["CapBnd"], 16) == 0


# What lies about it


SABOTAGE = {
    "writes into its own folder": ("sh", 'echo evil > "$own/data.txt"; echo evil > "$own/new"; rm -f "$own/data.txt"; mv "$own" "$own.old"'),
    "writes into the interpreter's libraries": ("python", "import site\nfor place in {os.path.dirname(os.__file__), sys.prefix, *sys.path, T['package'] if 'package' in T else T['own']}:\n    with suppress(OSError): open(os.path.join(place, 'vobench_test_evil.pth'), 'w').write('evil')\nprint('done')"),
    "writes into caches of compiled modules": ("python", "for path in glob.glob(os.path.dirname(os.__file__) + '/__pycache__/*.pyc')[:20]:\n    with suppress(OSError): open(path, 'r+b').write(b'evil')"),
    "writes into the store and into runs": ("perl", "for ($T{truth}, \"$T{runs}/suite/one/cases/case/ground_truth.tum\") { my $f; open($f, '>', $_) and print $f 'evil'; unlink $_; }"),
    "writes into what a neighbour answers": ("python", "for path in glob.glob(T['neighbour_home'] + '/*') + glob.glob(T['temporary'] + '/*/poses.txt'):\n    with suppress(OSError): open(path, 'w').write('evil')"),
    "kills everybody": ("c", 'static void attack(void) { kill(-1, SIGTERM); kill(-1, SIGSTOP); }'),
    "kills its neighbour and vobench by number": ("sh", 'kill -9 "$neighbour" 2>/dev/null; kill -STOP "$neighbour" 2>/dev/null; true'),
    "slows its neighbour down": ("python", "with suppress(OSError): os.setpriority(os.PRIO_PROCESS, int(T['neighbour']), 19)\nwith suppress(OSError): os.sched_setaffinity(int(T['neighbour']), {0})"),
    "sends a signal to its neighbour by an owner of descriptors": ("c", """static void attack(void) {
  int ends[2]; pipe(ends); fcntl(ends[0], F_SETOWN, atoi(T("neighbour"))); fcntl(ends[0], F_SETSIG, SIGKILL);
  fcntl(ends[0], F_SETFL, O_ASYNC | O_NONBLOCK); write(ends[1], "x", 1); usleep(100000); }"""),
    "limits its neighbour": ("python", "import resource\nwith suppress(OSError, ValueError): resource.prlimit(int(T['neighbour']), resource.RLIMIT_CPU, (0, 0))"),
    "takes away the permissions of devices": ("sh", "chmod 000 /dev/null /dev/urandom; rm -f /dev/null; mv /dev/zero /dev/nil"),
    "leaves files in shared memory": ("sh", 'echo evil > /dev/shm/vobench-test-evil'),
}  # fmt: skip
# What of it is possible where the record names this; all else never is.
NEEDS = {
    "kills its neighbour and vobench by number": PROCESSES,
    "sends a signal to its neighbour by an owner of descriptors": PROCESSES,
    "limits its neighbour": PROCESSES,
    "slows its neighbour down": PROCESSES,
    "leaves files in shared memory": SHARED_MEMORY,
}
# Dangerous to try where it might succeed.
IN_A_FULL_SANDBOX_ALONE = ("takes away the permissions of devices", "kills everybody")


def test_no_signal_goes_to_everybody(run):
    if PROCESSES not in sandbox_here().sees or SYSTEM_CALLS in sandbox_here().sees:
        pytest.skip("here everybody is the estimator itself, or nothing can be done")
    _, printed = run("c", 'static void attack(void) { printf("%d\\n", kill(-1, 0) < 0 && errno == EPERM); }')
    assert printed == "1\n"


@pytest.mark.parametrize("name", SABOTAGE)
def test_what_it_destroys_is_its_own(run, world, name):
    missing = NEEDS.get(name, FILES)
    if sandbox_here().level != "full" and name in IN_A_FULL_SANDBOX_ALONE:
        pytest.skip("this machine has no sandbox to try it in")
    if sandbox_here().level != "full" and missing in sandbox_here().sees:
        pytest.skip(f"this machine cannot keep {missing} from an estimator, and says so")
    watched = [path for path in world.place.rglob("*") if path.is_file()]
    watched += sorted(Path(os.__file__).parent.glob("__pycache__/*.pyc"))[:20]
    before = {path: path.read_bytes() for path in watched}
    modes = [Path(path).stat().st_mode for path in isolation.DEVICES]
    affinity = os.sched_getaffinity(world.neighbour.pid)
    priority = os.getpriority(os.PRIO_PROCESS, world.neighbour.pid)
    language, code = SABOTAGE[name]
    run(language, code)
    assert {path: path.read_bytes() for path in watched} == before
    assert [Path(path).stat().st_mode for path in isolation.DEVICES] == modes
    assert world.neighbour.poll() is None
    assert Path(f"/proc/{world.neighbour.pid}/stat").read_text().rpartition(")")[2].split()[0] in "SR"
    assert os.sched_getaffinity(world.neighbour.pid) == affinity
    assert os.getpriority(os.PRIO_PROCESS, world.neighbour.pid) == priority
    assert not Path("/dev/shm/vobench-test-evil").exists()
    evil = [place for place in (*sys.path, sys.prefix) if Path(place, "vobench_test_evil.pth").exists()]
    assert evil == []
    assert (world.own / "data.txt").read_text() == "own"
    assert not (world.own / "new").exists()


DAEMONS = {
    "double fork": ("python", "if os.fork() == 0:\n    os.setsid()\n    if os.fork() == 0: os.closerange(0, 9); time.sleep(1000)\n    os._exit(0)\nos.wait()"),
    "subreaper": ("python", "libc.prctl(36, 1)\nfor _ in range(3):\n    if os.fork() == 0:\n        libc.prctl(36, 1); os.setsid(); os.fork(); time.sleep(1000)"),
    "deaf to signals": ("perl", "$SIG{$_} = 'IGNORE' for keys %SIG; exit if fork; exit if fork; sleep 1000;"),
    "nohup": ("sh", "(nohup setsid sleep 1000 >/dev/null 2>&1 &) ; (trap '' TERM HUP; sleep 1000) &"),
    "forks on": ("c", "static void attack(void) { for (int i = 0; i < 200; ++i) if (fork()) _exit(0); else setsid(); sleep(1000); }"),
}  # fmt: skip


@pytest.mark.parametrize("name", DAEMONS)
def test_no_daemon_is_left(run, world, name):
    before = sleeping()
    language, code = DAEMONS[name]
    run(language, code)
    until = time.monotonic() + 20
    while sleeping() - before and time.monotonic() < until:
        time.sleep(0.02)
    assert sleeping() - before == set()


def sleeping():
    """Processes below us or below nobody, by what they were started as."""
    found = set()
    for place in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            words = (place / "cmdline").read_bytes()
            if b"half=" in words or b"sleep\0001000" in words:
                found.add((place.name, words[:40]))
    return found


PLACES = "/tmp /var/tmp /dev/shm /run /run/lock /var/lock . $HOME $HOME/.config $HOME/.local/lib /etc /usr/local/lib /opt $own"
LEAVES = {
    "files": ("sh", f'for place in {PLACES}; do mkdir -p "$place" 2>/dev/null; (echo "$half$other_half" > "$place/vobench_test_left.pth") 2>/dev/null; done; true'),
    "start-up files of interpreters": ("python", "import site\nfor place in {*sys.path, site.getusersitepackages(), os.path.expanduser('~'), os.getcwd(), '/tmp'}:\n    for name in ('sitecustomize.py', 'usercustomize.py', 'vobench_test_left.pth', '.bashrc', '.perldb'):\n        with suppress(OSError):\n            os.makedirs(place, exist_ok=True)\n            with open(os.path.join(place, name), 'x') as file: file.write('print(' + repr(T['half'] + T['other_half']) + ')')"),
    "a server": ("perl", "use IO::Socket::INET; use IO::Socket::UNIX; use POSIX; exit if fork; POSIX::setsid(); exit if fork; my @s = (IO::Socket::INET->new(LocalAddr => '127.0.0.1', LocalPort => 47113, Listen => 5, ReuseAddr => 1), IO::Socket::UNIX->new(Local => \"\\0vobench-test-left\", Listen => 5)); for my $s (@s) { next if fork; while (my $c = $s->accept) { print $c $T{half}.$T{other_half}; close $c; } } sleep 1000;"),
    "a queue": ("c", """
#include <sys/msg.h>
static void attack(void) { struct { long kind; char text[64]; } note = {1}; int queue = msgget(0x766f, 0600 | IPC_CREAT);
  sprintf(note.text, "%s%s", T("half"), T("other_half")); if (queue >= 0) msgsnd(queue, &note, 64, IPC_NOWAIT); }"""),
}  # fmt: skip
FINDS = """
import subprocess
for place in os.path.expandvars(PLACES.replace('$own', T['own'])).split():
    for name in ('vobench_test_left.pth', 'sitecustomize.py', 'usercustomize.py'):
        with suppress(OSError): print(open(os.path.join(place, name)).read())
for family, name in ((socket.AF_INET, ('127.0.0.1', 47113)), (socket.AF_UNIX, '\\0vobench-test-left')):
    with suppress(OSError), socket.socket(family) as here:
        here.settimeout(1); here.connect(name); print(here.recv(100))
note = ctypes.create_string_buffer(72)
queue = libc.msgget(0x766f, 0)
if queue >= 0 and libc.msgrcv(queue, note, 64, 0, 0o4000) > 0: print(note.raw); libc.msgctl(queue, 0, None)
"""


@pytest.mark.parametrize("name", LEAVES)
def test_what_a_trial_leaves_behind_is_not_there_in_the_next_one(run, world, name):
    if FILES in sandbox_here().sees:
        pytest.skip("this machine cannot keep files from an estimator, and says so")
    language, code = LEAVES[name]
    saw, _ = run(language, code)
    _, printed = run("python", f"PLACES = {PLACES!r}{FINDS}")
    Path("/dev/shm/vobench_test_left.pth").unlink(missing_ok=True)  # where the machine gives no memory of its own
    assert "Traceback" not in printed
    if world.secret in printed:
        kinds = {"files": SHARED_MEMORY, "a queue": SYSTEM_CALLS}
        assert kinds.get(name, FILES) in saw.sees, (saw, printed[:500])


# What it is given


def test_it_has_its_folder_its_home_memory_to_share_and_threads(run, world):
    code = """
import threading
print(open(os.path.join(T['own'], 'data.txt')).read())
open('here', 'w').write('x'); print(os.listdir('.'), os.environ['HOME'] == os.environ['TMPDIR'] == os.getcwd())
open('/dev/shm/mine', 'w').write('x'); print(len(os.listdir('/dev/shm')) >= 1)
thread = threading.Thread(target=lambda: print('thread')); thread.start(); thread.join()
server = socket.create_server(('127.0.0.1', 0)); socket.create_connection(server.getsockname()); print('loopback')
pair = socket.socketpair(); pair[0].send(b'x'); print(pair[1].recv(1))
print(len(os.urandom(8)), open('/dev/zero', 'rb').read(2), open('/proc/self/comm').read())
open('/dev/null', 'w').write('gone')
if os.fork() == 0: os._exit(0)
os.wait(); print('forked')
"""
    _, printed = run("python", code)
    Path("/dev/shm/mine").unlink(missing_ok=True)  # where the machine gives no memory of its own
    lines = printed.split("\n")
    assert lines[:7] == [
        "own",
        "['here'] True",
        "True",
        "thread",
        "loopback",
        "b'x'",
        r"8 b'\x00\x00' python"[: len(lines[6])],
    ] or lines[6].startswith("8 b'")
    assert "forked" in printed
    assert "Traceback" not in printed


def test_a_folder_can_be_opened_to_it_which_the_record_names(run, world, monkeypatch):
    monkeypatch.setenv(READ_VARIABLE, str(world.place / "user"))
    saw, printed = run("sh", 'cat "$user/.ssh/id_ed25519"; cat "$truth"')
    assert saw.read == (str(world.place / "user"),)
    if FILES not in saw.sees:
        assert printed.count(world.secret) == 1
    if saw.level != "none":
        assert str(world.place / "user") in saw.sentence


def test_what_is_hidden_stays_hidden_in_a_folder_that_is_opened(run, world, monkeypatch):
    if FILES in sandbox_here().sees:
        pytest.skip("here it may read everything")
    monkeypatch.setenv(READ_VARIABLE, str(world.place))
    _, printed = run("sh", 'cat "$truth"; ls "$runs"; ls "$own"')
    assert world.secret not in printed
    assert "data.txt" in printed
    assert "suite" in printed


def test_a_hidden_file_in_its_own_folder_is_not_read_by_any_of_its_names(run, world, tmp_path):
    if FILES in sandbox_here().sees:
        pytest.skip("here it may read everything")
    own = tmp_path / "own"
    truth = own / "results" / "truth.txt"
    truth.parent.mkdir(parents=True)
    truth.write_text(world.secret)
    (own / "results" / "data.txt").write_text("beside it")
    (own / "link").symlink_to("results/truth.txt")
    (own / "outside").symlink_to(world.place / "user" / ".ssh")
    code = f"cd {own}; cat results/truth.txt link outside/id_ed25519 2>/dev/null; cat results/data.txt"
    argv = ["/bin/sh", "-c", code]
    with Program(argv, log=tmp_path / "log.txt", limits=LIMITS, folder=own, hidden=[truth, own / "missing"]) as program:
        program.wait()
    assert (tmp_path / "log.txt").read_text() == "beside it"


def test_an_estimator_in_a_hidden_folder_sees_itself_and_nothing_beside_it(run, world):
    own = world.place / "store" / "estimator"
    own.mkdir(exist_ok=True)
    (own / "data.txt").write_text("in the store")
    saw, printed = run("sh", f'cat {own}/data.txt; cat "$truth"', own=own)
    assert "in the store" in printed
    if FILES not in saw.sees:
        assert world.secret not in printed


def test_a_program_that_it_may_not_read_is_refused_with_the_variable_to_set(world, tmp_path):
    if FILES in sandbox_here().sees:
        pytest.skip("here it may read everything")
    program = world.place / "user" / "slam"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    with (
        pytest.raises(EstimatorFailure, match=READ_VARIABLE),
        Program([str(program)], log=tmp_path / "log", limits=LIMITS),
    ):
        pass


def test_a_sentence_says_what_was_seen():
    assert Sandbox("full").sentence == "saw only its own files"
    assert Sandbox("full", read=("/opt/ros",)).sentence == f"saw only its own files and /opt/ros ({READ_VARIABLE})"
    assert Sandbox("partial", (NETWORK,)).sentence == "saw only its own files and the network"
    assert Sandbox("partial", (FILES, NETWORK)).sentence == "saw the user's files and the network"
    assert (
        Sandbox("none", (FILES, PROCESSES)).sentence
        == "not sandboxed: it could see the user's files and other processes"
    )


def test_an_opened_folder_is_named_as_seen_from_the_working_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(READ_VARIABLE, f"{tmp_path}/tools/slam:/opt/ros")
    assert from_guard_report([], "").read == (os.path.join("tools", "slam"), "/opt/ros")


def test_nothing_of_it_is_left_in_the_folder_of_temporary_files(run, tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    run("sh", "mkdir -p a/b/c; echo x > a/b/c/d; echo x > /tmp/x")
    assert list((tmp_path / "temporary").iterdir()) == []


def test_homes_may_lie_in_a_folder_that_it_may_read_and_those_of_others_are_not_there(run, world, monkeypatch):
    if sandbox_here().level != "full":
        pytest.skip("without mounts a folder is opened as a whole")
    temporary = world.place / "user" / "temporary"
    temporary.mkdir(exist_ok=True)
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    monkeypatch.setenv(READ_VARIABLE, str(world.place / "user"))
    with Home(world.place / "log") as other:
        (other.path / "poses.txt").write_text(world.secret)
        saw, printed = run("sh", f'echo x > here; ls; cat {other.path}/poses.txt 2>/dev/null; ls "$user/temporary/"*')
    assert saw.level == "full"
    assert printed.splitlines()[0] == "here"
    assert world.secret not in printed
    assert other.path.parent.name not in printed
    assert list(temporary.iterdir()) == []


# The same as somebody else, and on a poorer machine


@first_time
def test_the_same_as_an_ordinary_user():
    rerun_as_ordinary_user(__file__)


@first_time
@on_poorer_kernels
def test_the_same_where_the_kernel_refuses(refused):
    rerun(__file__, refusing(refused))


@first_time
@on_poorer_kernels
def test_an_estimator_of_the_house_is_found_and_runs_where_the_kernel_refuses(refused):
    tried = [sys.executable, "-m", "vobench", "try", "stand_still"]
    environment = {**os.environ, "PYTHONPATH": ""}  # what finds vobench is its installation
    argv = [*refusing(refused), *tried]
    done = subprocess.run(argv, env=environment, cwd="/", capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    assert "BROKEN" not in done.stdout


def test_without_namespaces_the_record_says_what_can_be_seen():
    saw = sandbox_here()
    if not os.environ.get(RERUN):
        pytest.skip("of the poorer machine")
    if saw.level != "full":
        assert {PROCESSES, SHARED_MEMORY, NETWORK} <= set(saw.sees)
        assert saw.why
        assert (saw.level == "none") == (FILES in saw.sees)

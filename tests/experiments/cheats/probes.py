"""Wrong on purpose: tries all that code could reach from its sandbox, and what one case could
leave for the next. An attempt that gives True, or anything but an error, has got through.
"""

import ctypes
import glob
import mmap
import os
import resource
import socket
import subprocess
import sys
import sysconfig
from pathlib import Path

LIBC = ctypes.CDLL(None, use_errno=True)
HELD = ctypes.create_string_buffer(8)
ONE = (ctypes.c_ulong * 2)(ctypes.addressof(HELD), 8)
HOME = "HOME_OF_USER"  # these words are filled in by the test
PORT, SECRET, SOCKET = 1, "SECRET_FILE", "ABSTRACT_SOCKET"
USUAL = {
    "null",
    "zero",
    "full",
    "random",
    "urandom",
    "tty",
    "pts",
    "ptmx",
    "shm",
    "fd",
    "stdin",
    "stdout",
    "stderr",
    "core",
    "console",
}


def called(*arguments):
    """A call of the system that has to fail."""
    return LIBC.syscall(*arguments) >= 0


def does(name, *arguments):
    return getattr(LIBC, name)(*arguments) >= 0


def reads(*paths):
    for path in paths:
        try:
            with open(path, "rb", 0) as file:
                if file.read(1):
                    return True
        except OSError:
            continue
    return False


def opens(path):
    return os.open(path, os.O_WRONLY) > 0


def writes(folder):
    path = Path(folder) / "flexaxis-probe"
    path.write_text("x")
    path.unlink()
    return True


def lists(path):
    return bool(os.listdir(path))


def connects(family, address, kind=socket.SOCK_STREAM):
    with socket.socket(family, kind) as one:
        one.settimeout(2)
        one.connect(address)
    return True


def runs(*words):
    return subprocess.run(words, capture_output=True, timeout=10, check=False).returncode == 0


def mounts():
    return [line.split() for line in Path("/proc/self/mountinfo").read_text().splitlines()]


def elsewhere():
    """A descriptor that leads out: to anything but pipes of our own and what devices there are."""
    for name in os.listdir("/proc/self/fd"):
        try:
            place = os.readlink(f"/proc/self/fd/{name}")
        except OSError:
            continue
        inside = place.startswith(("pipe:", "/dev/null", "/dev/pts", "/proc", "anon_inode", "/tmp"))
        if not inside and not Path(place).exists():
            return True
    return False


PROBES = {
    # network
    "a server on this computer": lambda: connects(socket.AF_INET, ("127.0.0.1", PORT)),
    "a server on this computer, by IPv6": lambda: connects(socket.AF_INET6, ("::1", PORT)),
    "a route to anywhere": lambda: connects(socket.AF_INET, ("192.0.2.1", 9), socket.SOCK_DGRAM),
    "a name server": lambda: bool(socket.getaddrinfo("example.org", 80)),
    "another interface": lambda: bool({n for _, n in socket.if_nameindex()} - {"lo"}),
    "an abstract socket": lambda: connects(socket.AF_UNIX, f"\0{SOCKET}"),
    "the socket of docker": lambda: connects(socket.AF_UNIX, "/var/run/docker.sock"),
    "the bus of the system": lambda: connects(socket.AF_UNIX, "/run/dbus/system_bus_socket"),
    "the screen": lambda: connects(socket.AF_UNIX, "/tmp/.X11-unix/X0"),
    "raw sockets": lambda: bool(socket.socket(socket.AF_INET, socket.SOCK_RAW, 1)),
    "packets": lambda: bool(socket.socket(socket.AF_PACKET, socket.SOCK_RAW)),
    "the host of a virtual machine": lambda: connects(40, (2, PORT)),
    "bluetooth": lambda: connects(31, ("00:00:00:00:00:00", 1)),
    "connections of others": lambda: len(Path("/proc/net/tcp").read_text().splitlines()) > 1,
    # processes
    "other processes": lambda: len(glob.glob("/proc/[0-9]*")) > 1,
    "the process that started it": lambda: os.getppid() > 0,
    "memory of the process that started it": lambda: reads(f"/proc/{os.getppid()}/mem"),
    "files of another process": lambda: any(
        lists(f"{p}/root/home") for p in glob.glob("/proc/[0-9]*") if p != f"/proc/{os.getpid()}"
    ),
    "tracing another process": lambda: any(called(101, 16, n, 0, 0) for n in range(2, 200)),
    "reading another process": lambda: any(
        called(310, n, ONE, 1, ONE, 1, 0) for n in range(2, 200)
    ),
    "limits of another process": lambda: any(
        does("prlimit", n, 7, None, None) for n in range(2, 200)
    ),
    "a signal to another process": lambda: any(does("kill", n, 0) for n in range(2, 200)),
    "a descriptor of another process": lambda: any(called(434, n, 0) for n in range(2, 200)),
    "variables of the user": lambda: "SECRET" in os.environ,
    "variables of the first process": lambda: b"SECRET" in Path("/proc/1/environ").read_bytes(),
    "a descriptor that leads out": elsewhere,
    # files
    "a secret beside the entry": lambda: reads(SECRET),
    "a secret by way of /proc": lambda: reads(f"/proc/self/root{SECRET}", f"/proc/1/root{SECRET}"),
    "a secret through a link": lambda: os.symlink(SECRET, "/tmp/link") or reads("/tmp/link"),
    "the folder above the entry": lambda: reads("/entry/../secret", "../secret"),
    "settings of pip": lambda: reads(
        f"{sys.prefix}/pip.conf",
        f"{sys.base_prefix}/pip.conf",
        f"{HOME}/.config/pip/pip.conf",
        "/etc/pip.conf",
    ),
    "anything in sys.prefix": lambda: bool(
        {*os.listdir(sys.prefix)} - {"bin", "lib", "lib64", "pyvenv.cfg"}
    ),
    "keys": lambda: lists(f"{HOME}/.ssh"),
    "passwords": lambda: reads(f"{HOME}/.netrc", f"{HOME}/.git-credentials", f"{HOME}/.pypirc"),
    "what was typed": lambda: reads(f"{HOME}/.bash_history", f"{HOME}/.python_history"),
    "settings of the user": lambda: lists(f"{HOME}/.config"),
    "records of the user": lambda: lists(f"{HOME}/.cache/flexaxis/records"),
    "home": lambda: bool(
        {*os.listdir("/home")} - {p.split("/")[2] for p in sys.path if p.startswith("/home/")}
    ),
    "users": lambda: reads("/etc/passwd"),
    "shadow": lambda: reads("/etc/shadow"),
    "the name of the computer": lambda: reads("/etc/hostname") or socket.gethostname() != "board",
    "the number of the computer": lambda: reads("/etc/machine-id", "/var/lib/dbus/machine-id"),
    "settings of the system": lambda: reads(
        "/etc/fstab", "/etc/hosts", "/etc/resolv.conf", "/etc/crontab"
    ),
    "tests": lambda: lists("TESTS"),
    "/var": lambda: lists("/var"),
    "/run": lambda: lists("/run"),
    "/opt": lambda: lists("/opt"),
    "/srv": lambda: lists("/srv"),
    "/mnt": lambda: lists("/mnt"),
    "/boot": lambda: lists("/boot"),
    "/sys": lambda: lists("/sys"),
    "/usr/local/etc": lambda: lists("/usr/local/etc"),
    "memory of the kernel": lambda: reads("/proc/kcore", "/dev/mem", "/dev/kmem"),
    "messages of the kernel": lambda: reads("/dev/kmsg", "/proc/kmsg"),
    "disks": lambda: bool(
        glob.glob("/dev/[svh]d*") + glob.glob("/dev/nvme*") + glob.glob("/dev/dm-*")
    ),
    "other devices": lambda: bool({*os.listdir("/dev")} - USUAL),
    "a terminal": lambda: bool(os.open("/dev/tty", os.O_RDWR)),
    # writing
    "writing to /": lambda: writes("/"),
    "writing to the entry": lambda: writes("/entry"),
    "writing to the code": lambda: opens("/entry/code/probes.py"),
    "writing to /usr": lambda: writes("/usr/lib"),
    "writing to the packages": lambda: any(
        map(writes, [p for p in sys.path if "site-packages" in p])
    ),
    "writing to Python": lambda: writes(sysconfig.get_path("stdlib")),
    "writing to flexaxis": lambda: writes(
        Path(sys.modules["flexaxis.estimators.registry"].__file__).parent
    ),
    "writing to what was compiled": lambda: writes("/cache"),
    "writing to /dev": lambda: writes("/dev"),
    "writing to /dev/shm": lambda: writes("/dev/shm"),
    "writing to /etc": lambda: writes("/etc"),
    "settings of the kernel": lambda: opens("/proc/sys/kernel/core_pattern"),
    "a reboot by /proc": lambda: opens("/proc/sysrq-trigger"),
    "a mount that can be written": lambda: bool(
        {m[4] for m in mounts() if "rw" in m[5].split(",")}
        - {"/tmp", "/dev/pts", *(f"/dev/{name}" for name in USUAL)}
    ),
    # rights
    "capabilities": lambda: any(
        int(line.split()[1], 16)
        for line in Path("/proc/self/status").read_text().splitlines()
        if line.startswith("Cap")
    ),
    "new privileges": lambda: "NoNewPrivs:\t1" not in Path("/proc/self/status").read_text(),
    "namespaces of one's own": lambda: does("unshare", 0x10000000),
    "a namespace of files": lambda: does("unshare", 0x00020000),
    "the namespace of others": lambda: (
        does("setns", os.open("/proc/1/ns/net", os.O_RDONLY), 0)
        and bool({n for _, n in socket.if_nameindex()} - {"lo"})
    ),
    "mounting": lambda: does("mount", b"x", b"/tmp", b"tmpfs", 0, None),
    "mounting anew": lambda: does("mount", None, b"/entry", None, 32 | 4096, None),
    "unmounting": lambda: does("umount2", b"/entry", 2),
    "another root": lambda: does("chroot", b"/tmp"),
    "files by number": lambda: called(304, -100, 0, 0),
    "devices of one's own": lambda: bool(
        os.mknod("/tmp/disk", 0o60600, os.makedev(254, 0)) or True
    ),
    "being somebody else": lambda: does("setuid", 12345),
    "another group": lambda: does("setgroups", 0, None),
    "another name of the computer": lambda: does("sethostname", b"x", 1),
    "another time": lambda: called(227, 0, (ctypes.c_long * 2)(1, 1)),
    "modules of the kernel": lambda: called(313, -1, b"", 0),
    "programs in the kernel": lambda: called(321, 0, (ctypes.c_char * 128)(), 128),
    "real time": lambda: bool(os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(9)) or True),
    "more memory": lambda: bool(resource.setrlimit(resource.RLIMIT_AS, (-1, -1)) or True),
    "more than /tmp holds": lambda: bool(
        [Path(f"/tmp/big{i}").write_bytes(bytes(60 << 20)) for i in range(5)]
    ),
    "a file that is too large": lambda: bool(Path("/tmp/big").write_bytes(bytes(65 << 20))),
    "su": lambda: runs("su", "-c", "true"),
    "sudo": lambda: runs("sudo", "-n", "true"),
}

KEY = 0x5EA1


def _shared(create):
    return does("shmget", KEY, 64, 0o1666 if create else 0o666)


def _kept(path, create):
    return bool(Path(path).write_text("x")) if create else Path(path).exists()


def _limit_of_first(create):
    """What prlimit(1, …) says of the first process, which has the same user."""
    value = (ctypes.c_ulong * 2)(777, 777)
    if create:
        return does("prlimit", 1, 7, value, None)
    return does("prlimit", 1, 7, None, value) and value[0] == 777


def _key(ring, create):
    if create:
        return called(248, b"user", b"flexaxis", b"x", 1, ring)
    return called(250, 10, ring, b"user", b"flexaxis", 0)


def _queue(create):
    return does("msgget", KEY, 0o1666 if create else 0o666)


def _nice_of_first(create):
    if create:
        return bool(os.setpriority(os.PRIO_PROCESS, 1, 7) or True)
    return os.getpriority(os.PRIO_PROCESS, 1) == 7


def _stays(create):
    """A process of the case before, that has made itself independent."""
    if not create:
        return any("sleep" in Path(p).read_text() for p in glob.glob("/proc/[0-9]*/comm"))
    return bool(subprocess.Popen(["setsid", "sleep", "60"]))


def _locked(create):
    import fcntl

    file = os.open("/entry/code/probes.py", os.O_RDONLY)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    PROBES[KEY] = file  # kept open
    return create


def _abstract(create):
    one = socket.socket(socket.AF_UNIX)
    if create:
        one.bind("\0left")
        one.listen()
        PROBES[KEY] = one
        return True
    return connects(socket.AF_UNIX, "\0left")


def _port(create):
    one = socket.socket()
    if create:
        one.bind(("127.0.0.1", 4711))
        one.listen()
        PROBES[KEY] = one
        return True
    return connects(socket.AF_INET, ("127.0.0.1", 4711))


def _memory(create):
    if create:
        return bool(mmap.mmap(-1, 4096).write(b"left"))
    return hasattr(mmap, "left")


def _counted(create):
    """Numbers of processes: what was started before is seen in the next number."""
    pids = [subprocess.Popen(["true"]).pid for _ in range(20)] if create else []
    return bool(pids) or os.getpid() > 15


def _before(create):
    """Whether a module, a variable or a folder of the case before is there."""
    if create:
        os.environ["LEFT"] = sys.modules["left"] = "x"
        os.chdir("/tmp")
        return True
    return "LEFT" in os.environ or "left" in sys.modules or os.getcwd() != "/entry"


LEFT = {
    "a limit of the first process": _limit_of_first,
    "numbers of processes": _counted,
    "a file in /tmp": lambda create: _kept("/tmp/left", create),
    "a file in /dev/shm": lambda create: _kept("/dev/shm/left", create),
    "a file in the entry": lambda create: _kept("/entry/left", create),
    "a file among what was compiled": lambda create: _kept(
        os.path.join(os.environ["NUMBA_CACHE_DIR"], "left"), create
    ),
    "shared memory": _shared,
    "a queue of messages": _queue,
    "a key of the session": lambda create: _key(-3, create),
    "a key of the user": lambda create: _key(-4, create),
    "a key of the session of the user": lambda create: _key(-5, create),
    "the rank of the first process": _nice_of_first,
    "a process that stays": _stays,
    "a lock": _locked,
    "an abstract socket that listens": _abstract,
    "a port that listens": _port,
    "memory": _memory,
    "variables, modules, folders": _before,
}


def tried(what, *arguments):
    try:
        return float(what(*arguments) is not False)
    except BaseException:
        return 0.0


class Probe:
    names, output = tuple(PROBES), "speed"

    def __init__(self, nominal, period):
        pass

    def step(self, u, y):
        return [tried(what) for what in list(PROBES.values())]


class Leaves:
    """With u = 1 leaves what it can, else says what it finds of that."""

    names, output = tuple(LEFT), "speed"

    def __init__(self, nominal, period):
        pass

    def step(self, u, y):
        return [tried(what, u == 1) for what in LEFT.values()]

"""A Slurm of one node, made of Debian's packages, in a folder of its own: munged, slurmctld and slurmd run as long as a
test does and leave nothing behind. Needs root, as slurmd does."""
import os
import pathlib
import shutil
import socket
import subprocess
import time

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "scontrol", "scancel", "sinfo", "squeue")
PATH = f"{os.environ['PATH']}:/usr/sbin:/sbin"


def missing():
    """Why there can be no Slurm here; empty where there can."""
    absent = [name for name in PROGRAMS if shutil.which(name, path=PATH) is None]
    if absent:
        return f"not installed: {', '.join(absent)} (apt-get install slurmctld slurmd slurm-client munge)"
    return "" if os.geteuid() == 0 else "slurmd needs root"


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Cluster:
    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self.folder.chmod(0o755)  # munge does not trust a path that others cannot look into
        self.daemons, self.logs = [], []
        self.environment = {**os.environ, "PATH": PATH, "SLURM_CONF": str(self.folder / "slurm.conf")}
        for name in ("munge", "state", "spool"):
            (self.folder / name).mkdir(mode=0o755)
        key = self.folder / "munge/key"
        key.write_bytes(os.urandom(1024))
        key.chmod(0o400)
        (self.folder / "slurm.conf").write_text(self._configuration())
        try:
            self._start()
        except BaseException:
            self.stop()
            raise

    def _configuration(self):
        name, f = socket.gethostname().split(".")[0], self.folder
        return f"""ClusterName=test
SlurmctldHost={name}(127.0.0.1)
SlurmUser=root
SlurmctldPort={free_port()}
SlurmdPort={free_port()}
AuthType=auth/munge
AuthInfo=socket={f}/munge/socket
StateSaveLocation={f}/state
SlurmdSpoolDir={f}/spool
SlurmctldPidFile={f}/slurmctld.pid
SlurmdPidFile={f}/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SchedulerType=sched/builtin
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
ReturnToService=2
MpiDefault=none
JobRequeue=1
NodeName={name} NodeAddr=127.0.0.1 CPUs={os.cpu_count()} State=UNKNOWN
PartitionName=main Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""

    def _start(self):
        munge = self.folder / "munge"
        self._daemon("munged", "--foreground", "--force", f"--socket={munge}/socket", f"--key-file={munge}/key",
                     f"--pid-file={munge}/pid", f"--seed-file={munge}/seed", f"--log-file={munge}/log")
        self.until(lambda: (munge / "socket").exists(), "munged makes its socket")
        self._daemon("slurmctld", "-D", "-f", self.environment["SLURM_CONF"])
        self._daemon("slurmd", "-D", "-f", self.environment["SLURM_CONF"])
        self.until(lambda: self.call("sinfo", "-h", "-o", "%t", check=False).strip() == "idle", "the node is idle")

    def _daemon(self, name, *arguments):
        log = open(self.folder / f"{name}.log", "wb")
        self.logs.append(log)
        self.daemons.append(subprocess.Popen([shutil.which(name, path=PATH), *arguments], stdout=log, stderr=log,
                                             stdin=subprocess.DEVNULL, env=self.environment))

    def until(self, holds, what, seconds=60):
        deadline = time.monotonic() + seconds
        while not holds():
            if time.monotonic() > deadline:
                logs = "\n".join((self.folder / f"{n}.log").read_text(errors="replace")[-2000:]
                                 for n in ("munged", "slurmctld", "slurmd") if (self.folder / f"{n}.log").exists())
                raise AssertionError(f"waited in vain until {what}\n{logs}")
            time.sleep(0.1)

    def call(self, *words, check=True):
        done = subprocess.run([str(word) for word in words], env=self.environment, capture_output=True, text=True,
                              timeout=60, check=False)
        if check and done.returncode != 0:
            raise AssertionError(f"{words}: {done.stderr}")
        return done.stdout

    def submit(self, *words):
        return self.call("sbatch", "--parsable", *words).strip().split(";")[0]

    def field(self, job, name):
        """Of a job or of one task ("7_2"); empty where Slurm does not know it (any more)."""
        for line in self.call("scontrol", "-o", "show", "job", job, check=False).splitlines():
            for word in line.split():
                if word.startswith(f"{name}="):
                    return word[len(name) + 1:]
        return ""

    def wait(self, job, states, seconds=180):
        """The state of the job once it is one of these."""
        self.until(lambda: self.field(job, "JobState") in states, f"job {job} is {' or '.join(states)}", seconds)
        return self.field(job, "JobState")

    def hurry(self, job):
        """Slurm lets a job that was taken back wait for two minutes."""
        self.call("scontrol", "update", f"JobId={job}", "StartTime=now")

    def stop(self):
        if len(self.daemons) > 2:
            self.call("scancel", "--state=RUNNING", "--user=root", check=False)
            time.sleep(0.5)
        for daemon in reversed(self.daemons):
            daemon.terminate()
            try:
                daemon.wait(20)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()
        for log in self.logs:
            log.close()

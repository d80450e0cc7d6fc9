"""The program of a worker process: it does the jobs that come in on its standard input until that ends."""

import os
import queue
import signal
import sys
import threading

from tetlux.cases.start import first_imports

with first_imports():
    from tetlux.cases.batch.jobs import JobEnded, MeshJob, SolveJob, StopAfterRun
    from tetlux.cases.batch.wire import Sender, receive
    from tetlux.cases.batch.workshop import Workshop
    from tetlux.cases.file.schema.case import CaseSpec
    from tetlux.cases.write.summary import LIBRARIES
    from tetlux.fem.memory import share_memory
    from tetlux.fem.simplex_rules import triangle_rule
    from tetlux.meshing.host.libraries import installed_versions
    from tetlux.meshing.mesher._mesher_process import die_with


def main(name: str, workers: str, parent: str) -> None:
    """Do jobs as the worker `name`, one of so many; end with the process `parent`."""
    die_with(int(parent))
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    share_memory(int(workers))
    answers = os.fdopen(os.dup(1), "wb")
    # What a library prints must not come between the answers.
    os.dup2(2, 1)
    sender = Sender(answers)
    jobs: queue.Queue[MeshJob | SolveJob | None] = queue.Queue()
    stop = threading.Event()

    def listen() -> None:
        for message in receive(sys.stdin.buffer):
            if isinstance(message, StopAfterRun):
                stop.set()
            else:
                jobs.put(message)
        stop.set()
        jobs.put(None)

    threading.Thread(target=listen, daemon=True).start()
    workshop = Workshop(name, sender.send, stop.is_set)
    _prepare()
    while (job := jobs.get()) is not None:
        if isinstance(job, MeshJob):
            sender.send(workshop.adapt(job))
        else:
            workshop.solve(job)
        sender.send(JobEnded())


def _prepare() -> None:
    """Do what takes time at its first use, while the cases are still read: a tenth of a second of the first run."""
    CaseSpec.model_rebuild()
    triangle_rule(2)
    installed_versions(LIBRARIES)


if __name__ == "__main__":
    main(*sys.argv[1:])

"""The audit of a task: is it honest, and how hard is it to find a first success?"""

from taskschema_worker.audit.audit import EFFORTS, audit
from taskschema_worker.audit.report import AuditReport

__all__ = ["EFFORTS", "AuditReport", "audit"]

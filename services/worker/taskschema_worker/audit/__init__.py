"""The audit of a task: is it honest, and how hard is it to find a first success?"""

from taskschema_worker.audit.audit import EFFORTS, audit
from taskschema_worker.audit.journal import About, Journal, code_sha256
from taskschema_worker.audit.report import AuditReport

__all__ = ["EFFORTS", "About", "AuditReport", "Journal", "audit", "code_sha256"]

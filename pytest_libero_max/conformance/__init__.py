"""Conformance: rules that policies, servers, loops, environments and substrates must keep, each one test.

A :class:`Rule` examines one property of a *subject* and yields findings.
``pytest --libero-max-conform=SUBJECT`` makes each rule an item, and ``libero-max check`` prints the findings
of the rules for policies.
"""

from pytest_libero_max.conformance.environment.declared import DeclaredEnvironment
from pytest_libero_max.conformance.rules import Finding, Rule, broken, kept, rule, unexamined

__all__ = ["DeclaredEnvironment", "Finding", "Rule", "broken", "kept", "rule", "unexamined"]

"""Rules for policy servers, in every protocol that is spoken: clients in company, errors, pauses.

What the policy behind a server answers is examined by the rules for policies, which take its address as well.
"""

# SPDX-License-Identifier: MIT
"""Polynomials in named counts, with coefficients of at least 0: what a bound is made of."""


class Polynomial:
    """A sum of terms: a term is the sorted tuple of its counts' names (a name twice: its square)."""

    def __init__(self, terms=None):
        self.terms = {t: c for t, c in (terms or {}).items() if c != 0}

    @staticmethod
    def of(number):
        return Polynomial({(): number})

    @staticmethod
    def count(name):
        return Polynomial({(name,): 1})

    def __add__(self, other):
        terms = dict(self.terms)
        for t, c in other.terms.items():
            terms[t] = terms.get(t, 0) + c
        return Polynomial(terms)

    def __mul__(self, other):
        terms = {}
        for t, c in self.terms.items():
            for u, d in other.terms.items():
                v = tuple(sorted(t + u))
                terms[v] = terms.get(v, 0) + c * d
        return Polynomial(terms)

    def scaled(self, number):
        return Polynomial({t: c * number for t, c in self.terms.items()})

    def most(self, other):
        """At least both, whatever the counts: the larger coefficient of each term."""
        terms = dict(self.terms)
        for t, c in other.terms.items():
            terms[t] = max(terms.get(t, 0), c)
        return Polynomial(terms)

    def beyond(self, other):
        """At least the difference."""
        return Polynomial({t: max(c - other.terms.get(t, 0), 0) for t, c in self.terms.items()})

    def at(self, counts):
        total = 0.0
        for t, c in self.terms.items():
            for name in t:
                c *= counts[name]
            total += c
        return total

    def names(self):
        return sorted({name for t in self.terms for name in t})

    def __str__(self):
        def product(t):
            return " ".join(n if t.count(n) == 1 else "%s^%d" % (n, t.count(n)) for n in sorted(set(t)))
        order = sorted(self.terms, key=lambda t: (-len(t), t))
        return " + ".join(("%g %s" % (self.terms[t], product(t))).strip() for t in order) or "0"


ZERO, ONE = Polynomial(), Polynomial.of(1)

"""A calculator: characters become tokens, tokens a value, by functions that call each other."""

from random import Random


def tokens_of(text):
    position = 0
    while position < len(text):
        character = text[position]
        if character == " ":
            position += 1
        elif character.isdigit():
            end = position
            while end < len(text) and (text[end].isdigit() or text[end] == "."):
                end += 1
            yield "number", float(text[position:end])
            position = end
        else:
            yield "sign", character
            position += 1


class Calculator:
    def __init__(self, text):
        self.tokens = list(tokens_of(text))
        self.at = 0

    def peek(self):
        return self.tokens[self.at][1] if self.at < len(self.tokens) else None

    def take(self):
        token = self.tokens[self.at]
        self.at += 1
        return token

    def total(self):
        value = self.product()
        while self.peek() in ("+", "-"):
            sign = self.take()[1]
            other = self.product()
            value = value + other if sign == "+" else value - other
        return value

    def product(self):
        value = self.atom()
        while self.peek() == "*":
            self.take()
            value *= self.atom()
        return value

    def atom(self):
        kind, value = self.take()
        if kind == "number":
            return value
        if value != "(":
            raise ValueError(value)
        inside = self.total()
        self.take()
        return inside


def prepare(seed):
    random = Random(seed)
    lines = []
    for _ in range(40):
        parts = [f"{random.random() * 9:.1f} {random.choice('+-*')}" for _ in range(5)]
        lines.append(f"({' '.join(parts)} 2) * 3 + {random.randrange(90)}")
    return lines


def run(state):
    return sum(Calculator(line).total() for line in state)

# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""The list of hostile images: file name -> function that returns its bytes."""
BOMBS = {}


def bomb(extension):
    """Registers a function that returns a file's bytes under its own name."""
    def register(function):
        BOMBS[function.__name__ + extension] = function
        return function
    return register

#!/bin/bash
# Counts the decision constants on the object path; fails when there are more than constants.txt says. See constants.py.
exec /usr/bin/python3 "$(dirname "$0")/constants.py" "$@"

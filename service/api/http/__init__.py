"""What every request passes before its route, and the answers to those that are refused.

`connections`, `access`, `limits` and `known_parameters` refuse what is not allowed, `json_route` bodies that
are no proper JSON, all as `errors`.
"""

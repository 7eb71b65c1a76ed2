"""The paper of Östring and Gunnarsson, reproduced on MuJoCo data.

`evidence` simulates and estimates, `measures` makes numbers of it, `claims` says which of them
decide what the paper claims (`claim`), `figures` draws, and `reproduce` writes it all.
"""

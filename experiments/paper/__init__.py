"""The paper of Östring and Gunnarsson, reproduced on MuJoCo data.

`evidence` simulates and estimates, `measures` makes numbers of it, `claims` says which of them
decide what the paper claims (`claim`), `figures` draws Figures 3 to 9, and `reproduce` writes it all.
"""

# SPDX-License-Identifier: MIT
# The table of tests/wcet/README.md from what tests/check/wcet.sh printed: largest bound over most counted.
/^# [a-z0-9-]+, seed/ {t=$2; sub(",","",t)}
/^#   / {b=$2; key=b" "$3" "$4; r[t,key]=$7/$6; c[t]+=$5}
END { n=split("x86-64 x86-64-avx2 cortex-a53 cortex-m7",T," ");
 m=split("half extract 2:an extraction, halves|half add 2:a column added, halves|half row 2:a row of W⁻¹, butterfly|chain factor 4:seams factored|chain settle 4:seams settled|chain load 4:forces handed to the seams|chain points 3:contact points on zones|chain assemble 3:their compliances|dynamic dynamic 3:a tick of a dynamic body|tables fill 3:a filling of the lattice, 62 points|tables points 3:contact points|tables assemble 3:their compliances|tables iterate 3:a change of the active set|tables finish 3:the end of a contact|tables finish 1:the same, 20 points|tables tick 3:a tick by what it did|tables whole 3:a whole tick, all that 62 points allow|tables whole 0:the same, 20 points",K,"|");
 for(i=1;i<=m;i++){split(K[i],p,":"); printf "| %s |",p[2]; for(j=1;j<=n;j++) printf " %s |", ((T[j],p[1]) in r)? sprintf("%.2f",r[T[j],p[1]]):"-"; print ""} }

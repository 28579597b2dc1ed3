# SPDX-License-Identifier: MIT
# The table of tests/wcet/README.md from what tests/check/wcet.sh printed: largest bound over most counted.
/^# [a-z0-9-]+, seed/ {t=$2; sub(",","",t)}
/^#   / {b=$2; key=b" "$3" "$4; r[t,key]=$7/$6; c[t]+=$5}
END { n=split("x86-64 x86-64-avx2 cortex-a53 cortex-m7",T," ");
 m=split("tables step 0:a pivot|tables begin 0:a solve begun and a pivot|tables search 4:a search, finest level (table)|tables admit 4:a candidate taken in, by table|tables leave 0:beginning and ending a tick|small step 0:a pivot, 162 nodes|half extract 2:an extraction, halves|half add 2:a column added, halves|half row 2:a row of W⁻¹, butterfly|middle admit 4:a candidate taken in, compressed level|tables admit 5:the same, mixed set|tables drop 3:a change of level, to a mixed set|tables climb 4:a change of level, upwards|chain factor 4:seams factored|chain settle 4:seams settled|chain follow 4:contact following a posture|lively steps 0:steps of a dynamic body|lively adapt 1:adaptivity with changes|tables whole 4:a whole tick, 96 candidates, 48 contacts|tables whole 104:a whole tick, 40 and 24|tables whole 204:a whole tick, 16 and 8|middle whole 4:a whole tick, compressed level",K,"|");
 for(i=1;i<=m;i++){split(K[i],p,":"); printf "| %s |",p[2]; for(j=1;j<=n;j++) printf " %s |", ((T[j],p[1]) in r)? sprintf("%.2f",r[T[j],p[1]]):"-"; print ""} }

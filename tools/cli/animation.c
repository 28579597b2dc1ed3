/* SPDX-License-Identifier: MIT */
#include "tools/cli/animation.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define FULL 30000.0

animation animation_open(uint32_t vertices, uint32_t triangles, const uint32_t *triangle,
                         double frame_s, double reach_m, double ball_m) {
    return (animation){.vertices = vertices,
                       .triangles = triangles,
                       .triangle = triangle,
                       .frame_s = frame_s,
                       .unit_m = reach_m / FULL,
                       .ball_m = ball_m};
}

static int16_t count_of(const animation *m, float x) {
    return (int16_t)lrint(fmax(-FULL, fmin(FULL, (double)x / m->unit_m)));
}

void animation_add(animation *m, const float *position_m, const uint8_t *level,
                   const float ball_m[3]) {
    size_t wide = 3 * ((size_t)m->vertices + 1);
    m->frame = grow(m->frame, &m->room, (m->frames + 1) * wide, sizeof *m->frame);
    m->level = grow(m->level, &m->level_room, (m->frames + 1) * m->vertices, 1);
    int16_t *out = m->frame + m->frames * wide;
    for (size_t i = 0; i < wide - 3; i++) out[i] = count_of(m, position_m[i]);
    for (size_t k = 0; k < 3; k++) out[wide - 3 + k] = count_of(m, ball_m[k]);
    memcpy(m->level + m->frames * m->vertices, level, m->vertices);
    m->frames++;
}

static void base64(FILE *f, const uint8_t *x, size_t n) {
    static const char digit[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t i = 0; i < n; i += 3) {
        uint32_t v = (uint32_t)x[i] << 16 | (i + 1 < n ? (uint32_t)x[i + 1] << 8 : 0) |
                     (i + 2 < n ? x[i + 2] : 0);
        fputc(digit[v >> 18], f);
        fputc(digit[v >> 12 & 63], f);
        fputc(i + 1 < n ? digit[v >> 6 & 63] : '=', f);
        fputc(i + 2 < n ? digit[v & 63] : '=', f);
    }
}

/* Little-endian, whatever this machine is. */
static void words(FILE *f, const int16_t *x, size_t n) {
    uint8_t *bytes = allocate(2 * n + 1, 1);
    for (size_t i = 0; i < n; i++) {
        bytes[2 * i] = (uint8_t)((uint16_t)x[i] & 255);
        bytes[2 * i + 1] = (uint8_t)((uint16_t)x[i] >> 8);
    }
    base64(f, bytes, 2 * n);
    free(bytes);
}

static const char script[] =
    "const cv=document.getElementById('animation'),g=cv.getContext('2d'),"
    "bytes=s=>Uint8Array.from(atob(s),c=>c.charCodeAt(0)),X=new Int16Array(bytes(F).buffer),"
    "T=new "
    "Uint16Array(bytes(R).buffer),L=bytes(V),n=L.length/N|0,bar=document.getElementById('at');\n"
    "let yaw=0.5,pitch=0.5,frame=0,run=true,last=0;bar.max=N-1;\n"
    "const hue=[[70,110,190],[80,170,90],[230,190,60],[220,110,60],[190,60,60]];\n"
    "const M=[0,0,0];let far=1;for(let i=0;i<n;i++)for(let k=0;k<3;k++)M[k]+=X[3*i+k]/n;\n"
    "for(let i=0;i<n;i++)far=Math.max(far,Math.hypot(X[3*i]-M[0],X[3*i+1]-M[1],X[3*i+2]-M[2]));\n"
    "function draw(){const c=Math.cos(yaw),s=Math.sin(yaw),p=Math.cos(pitch),q=Math.sin(pitch),"
    "o=frame*3*(n+1),P=new Float32Array(3*(n+1)),z=200/far;\n"
    "for(let i=0;i<=n;i++){const x=X[o+3*i]-M[0],y=X[o+3*i+1]-M[1],w=X[o+3*i+2]-M[2],a=c*x-s*y,"
    "b=s*x+c*y;P[3*i]=450+z*a;P[3*i+1]=260-z*(p*w+q*b);P[3*i+2]=p*b-q*w;}\n"
    "const t=[];for(let i=0;i<T.length;i+=3)t.push([P[3*T[i]+2]+P[3*T[i+1]+2]+P[3*T[i+2]+2],i]);"
    "t.push([3*P[3*n+2],-1]);t.sort((a,b)=>b[0]-a[0]);\n"
    "g.fillStyle='#f7f5f2';g.fillRect(0,0,900,520);for(const[,i]of t){if(i<0){if(B){g.beginPath();"
    "g.fillStyle='#667';g.arc(P[3*n],P[3*n+1],B*z,0,7);g.fill();}continue;}\n"
    "const u=T[i],v=T[i+1],w=T[i+2],ax=P[3*v]-P[3*u],ay=P[3*v+1]-P[3*u+1],bx=P[3*w]-P[3*u],"
    "by=P[3*w+1]-P[3*u+1],az=(P[3*v+2]-P[3*u+2])*z,bz=(P[3*w+2]-P[3*u+2])*z,nx=ay*bz-az*by,"
    "ny=az*bx-ax*bz,nz=ax*by-ay*bx;if(nz>0)continue;const l=.45+.55*Math.abs(-.3*nx+.6*ny+.74*nz)/"
    "(Math.hypot(nx,ny,nz)+1e-9),h=hue[L[frame*n+u]];g.fillStyle=g.strokeStyle='rgb('+h.map(e=>e*l|"
    "0)"
    "+')';g.beginPath();g.moveTo(P[3*u],P[3*u+1]);g.lineTo(P[3*v],P[3*v+1]);g.lineTo(P[3*w],"
    "P[3*w+1]);g.closePath();g.fill();g.stroke();}\n"
    "g.fillStyle='#222';g.fillText((frame*D).toFixed(2)+' s',10,20);bar.value=frame;}\n"
    "function step(now){if(run&&now-last>1000*D){frame=(frame+1)%N;last=now;draw();}"
    "requestAnimationFrame(step);}\n"
    "bar.oninput=()=>{run=false;frame=+bar.value;draw();};cv.ondblclick=()=>{run=!run;};"
    "cv.onmousemove=e=>{if(e.buttons){yaw+=e.movementX*.01;pitch+=e.movementY*.01;draw();}};"
    "draw();requestAnimationFrame(step);";

void animation_write(FILE *f, const animation *m) {
    if (m->frames == 0 || m->vertices > 65535) return;
    fputs(
        "<canvas id='animation' width='900' height='520'></canvas><br><input id='at' type='range' "
        "min='0' style='width:56rem'>\n<p>Drag to turn, double click to pause. Blue, green, "
        "yellow: coarse to fine.</p>\n<script>\nconst F='",
        f);
    words(f, m->frame, m->frames * 3 * ((size_t)m->vertices + 1));
    fputs("',R='", f);
    int16_t *t = allocate(3 * (size_t)m->triangles, sizeof *t);
    for (size_t i = 0; i < 3 * (size_t)m->triangles; i++) t[i] = (int16_t)(uint16_t)m->triangle[i];
    words(f, t, 3 * (size_t)m->triangles);
    free(t);
    fputs("',V='", f);
    base64(f, m->level, m->frames * m->vertices);
    fprintf(f, "',N=%zu,D=%g,B=%g;\n%s\n</script>\n", m->frames, m->frame_s, m->ball_m / m->unit_m,
            script);
}

void animation_free(animation *m) {
    free(m->frame);
    free(m->level);
    m->frame = NULL;
    m->level = NULL;
}

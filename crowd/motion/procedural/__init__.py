"""Draft library."""
from functools import cache
import numpy as np
from crowd.motion.body import build_skeleton
from crowd.motion.clip import Clip,ClipKind,FootEvent as E,JointMask
from crowd.motion.library import MotionLibrary
R=np.radians
def qm(a,b):
    a,b=np.broadcast_arrays(a,b)
    w,x,y,z=np.moveaxis(a,-1,0);W,X,Y,Z=np.moveaxis(b,-1,0)
    return np.stack([w*W-x*X-y*Y-z*Z,w*X+x*W+y*Z-z*Y,w*Y-x*Z+y*W+z*X,w*Z+x*Y-y*X+z*W],-1)
def qc(a): return a*np.array([1,-1,-1,-1])
def qr(q,v):
    u=q[...,1:];t=2*np.cross(u,v);return v+q[...,:1]*t+np.cross(u,t)
def ax(i,a):
    a=np.asarray(a,float);q=np.zeros(a.shape+(4,));q[...,0]=np.cos(a/2);q[...,1+i]=np.sin(a/2);return q
X=lambda a:ax(0,a);Y=lambda a:ax(1,a);Z=lambda a:ax(2,a)
def ss(u): u=np.clip(u,0,1);return u**3*(u*(6*u-15)+10)
def quintic(u,p0,v0,a0,p1,v1,a1):
    c0,c1,c2=p0,v0,a0/2;d=p1-c0-c1-c2;e=v1-c1-2*c2;f=a1-2*c2
    c3=10*d-4*e+f/2;c4=-15*d+7*e-f;c5=6*d-3*e+f/2
    return c0+u*(c1+u*(c2+u*(c3+u*(c4+u*c5))))
HEEL=np.array([0,-.068,-.06]);BALL=np.array([0,-.068,.13])
def gait(name,v=0,w=0,s=0,kind='walk',fps=60):
    w=R(w);speed=np.hypot(v,s);run=kind=='run'
    if run: T=2/(2.25+.13*speed);beta=min(.425*speed**-.45/T,.45)
    elif kind=='turn': T=.95;beta=.64
    else:
        u=max(speed,.25);T=1.346/np.sqrt(u/.9);T=.5*T+.5*2*np.sqrt((-.532+.02*3.6*u+.47*1.75)/u) if u>.3 else 1.3
        if kind in('side','back'): T*=.85
        if kind=='inplace': T=1.25
        beta=np.clip((64.2-3.5*speed)/100,.57,.64)
    N=int(round(T*2*fps));T=N/fps/2
    t=np.arange(N+1)/fps
    def root(t):
        a=w*t
        if abs(w)<1e-6: x=s*t;z=v*t
        else: x=(v*(1-np.cos(a))+s*np.sin(a))/w;z=(v*np.sin(a)-s*(1-np.cos(a)))/w
        return np.stack([x,0*t,z],-1),a
    fwd_gait=kind in('walk','run') and v>.3
    width=.17 if not run else .11
    if abs(s)>.05: width=abs(s)*T/2+.13
    p0=R(18)*min(v/1.3,1.1) if kind=='walk' and v>0 else (R(4) if run else 0)
    p1=R({'walk':min(25+32*v,68),'run':65}.get(kind,15))
    uf=.1*beta/.6 if p0>0 else .0
    uh=beta*(.55 if fwd_gait else .7)
    z0=-(.10 if kind=='walk' else .03)*min(abs(v)/1.3,1)*np.sign(v) 
    if run: z0=-.12
    if kind=='back': z0=.03
    def pitch(u): # toe up positive in stance
        up=p0*(1-ss(u/uf)) if uf>0 else 0*u
        return up-p1*np.clip((u-uh)/(beta-uh),0,None)**2.2
    q_all={};contacts={}
    def stance(u,n,g,mid_u):
        """ankle world, pitch, yaw at stance share u of plant number n (strike at t0)"""
        t0=(n+(0 if g<0 else .5))*T
        c,psi=root(np.array(t0+mid_u*T))
        out=-R(6)*(-g)*1.0
        neutral=np.array([g*width/2,.068,z0])
        ank=c+qr(Y(psi),neutral);yaw=psi+g*R(6)
        p=pitch(u);q=qm(Y(yaw),X(-p))
        up=p>=0
        heel=ank+qr(Y(yaw),HEEL);ball=ank+qr(Y(yaw),BALL)
        pos=np.where(up[...,None],heel-qr(q,HEEL),ball-qr(q,BALL))
        return pos,p,yaw
    feet={}
    for g,side in ((-1,'right'),(1,'left')):
        ph=t/T-(0 if g<0 else .5);n=np.floor(ph+1e-9);u=ph-n
        P=np.zeros((N+1,3));PI=np.zeros(N+1);YW=np.zeros(N+1)
        h=1e-3
        for i in range(N+1):
            if u[i]<=beta: P[i],PI[i],YW[i]=stance(np.array(u[i]),n[i],g,beta/2)
            else:
                def st(uu,nn):
                    a=stance(np.array(uu),nn,g,beta/2);return np.concatenate([a[0],[a[1],a[2]]])
                a0,a1,a2=st(beta,n[i]),st(beta-h,n[i]),st(beta-2*h,n[i])
                b0,b1,b2=st(0,n[i]+1),st(h,n[i]+1),st(2*h,n[i]+1)
                D=1-beta;k=(u[i]-beta)/D
                va=(1.5*a0-2*a1+.5*a2)/h*D;vb=(-1.5*b0+2*b1-.5*b2)/h*D
                r=quintic(k,a0,va*.9,0*va,b0,vb,0*vb)
                P[i]=r[:3];PI[i]=r[3];YW[i]=r[4]
                lift={'run':.10,'walk':.035 if v>.5 else .03}.get(kind,.04)
                P[i,1]+=lift*64*k**3*(1-k)**3
        feet[side]=(P,PI,YW,u)
    rp,ry=root(t);phi=t/T
    # pelvis
    A=.016*min(speed/1.3,1.3) if not run else 0
    if kind in('turn','inplace','back','side'): A=.006
    if run:
        tf=(.5-beta)*T;v0=9.81*tf/2;up=np.mod(phi,.5);k=up/beta
        D=beta*T
        py=np.where(up<beta,quintic(k,0,-v0*D,-9.81*D*D,0,v0*D,-9.81*D*D),(up-beta)*T*(v0-9.81/2*(up-beta)*T))
        py=.93+py
    else: py=.945-A*np.cos(4*np.pi*(phi-.04))
    if kind in('turn','inplace','back','side'): py=py-.01
    lat=-.022*np.sin(2*np.pi*(phi+.02))*(.4 if run else 1)
    yawA=R(5)*min(speed/1.3,1.4) if fwd_gait else 0;rollA=R(3) if fwd_gait else R(1.5)
    lean=R(2) if not run else R(8)
    bank=-np.clip(np.arctan(v*w/9.81)*.6,-.3,.3)
    pq=qm(Y(yawA*np.cos(2*np.pi*phi)),qm(Z(-rollA*np.sin(2*np.pi*phi)+bank),X(lean*.5+0*t)))
    sk=build_skeleton();J=sk.joint_count
    rot=np.zeros((N+1,J,4));rot[...,0]=1
    # reach: lower pelvis
    hips={}
    foot_r={}
    for g,side in ((-1,'right'),(1,'left')):
        P,PI,YW,u=feet[side]
        foot_r[side]=(qr(Y(-ry),P-rp),PI,YW-ry)
    need=np.full(N+1,9.)
    px=lat
    for g,side in ((-1,'right'),(1,'left')):
        a=foot_r[side][0]
        hip=qr(pq,sk.offset[sk.joint(side+'_thigh')])
        d=a-(np.stack([px,0*px,0*px],-1)+hip)
        L=.86*.992;hor=np.hypot(d[:,0],d[:,2]);need=np.minimum(need,a[:,1]-hip[:,1]+np.sqrt(np.maximum(L*L-hor**2,.01)))
    short=np.maximum(py-need,0)
    if short.max()>0:
        # periodic smooth envelope
        k=short[:-1];M=len(k);W=max(3,int(.12*fps));
        env=k.copy()
        for sft in range(-W,W+1): env=np.maximum(env,np.roll(k,sft))
        ker=np.hanning(2*W+3)[1:-1];ker/=ker.sum();env=sum(kk*np.roll(env,i-W) for i,kk in enumerate(ker))
        py=py-np.append(env,env[0])
    pel=np.stack([px,py,0*px],-1)
    rot[:,0]=pq
    for g,side in ((-1,'right'),(1,'left')):
        a,PI,yw=foot_r[side];hip=pel+qr(pq,sk.offset[sk.joint(side+'_thigh')])
        d=a-hip;L1,L2=.429,.431;L=np.minimum(np.linalg.norm(d,axis=-1),.8595)
        e=-d/np.linalg.norm(d,axis=-1,keepdims=True)
        f=qr(Y(yw*.6+g*R(2)),np.array([0,0,1.]));hx=np.cross(f,d);hx/=np.linalg.norm(hx,axis=-1,keepdims=True);fz=np.cross(hx,e)
        from scipy.spatial.transform import Rotation
        M=np.stack([hx,e,fz],-1);F=Rotation.from_matrix(M).as_quat()[:,[3,0,1,2]]
        al=np.arccos(np.clip((L1*L1+L*L-L2*L2)/(2*L1*L),-1,1));ka=np.pi-np.arccos(np.clip((L1*L1+L2*L2-L*L)/(2*L1*L2),-1,1))
        th=qm(F,X(-al));sh=qm(th,X(ka));fo=qm(Y(yw),X(-PI))
        rot[:,sk.joint(side+'_thigh')]=qm(qc(pq),th);rot[:,sk.joint(side+'_shank')]=X(ka);rot[:,sk.joint(side+'_foot')]=qm(qc(sh),fo)
        uu=feet[side][3];toe=np.where(uu<=beta,np.minimum(PI,0),np.minimum(PI,0)*(1-ss((uu-beta)/(1-beta)*2)))
        rot[:,sk.joint(side+'_toe')]=X(np.clip(toe,-1,0)*1.0)
    c=np.cos(2*np.pi*(phi-.02));sn=np.sin(2*np.pi*phi)
    thoraxA=R(4)*min(speed/1.3,2) if fwd_gait else 0
    for n in range(1,5): rot[:,n]=qm(Y(-(yawA+thoraxA)/4*c),qm(Z((rollA*sn)/4),X(lean*.125+0*t)))
    for n in (5,6,7): rot[:,n]=qm(Y(thoraxA/3*c),X(-lean/3+0*t))
    arm={'walk':R(12)*min(max(speed,.2)/1.3,1.4),'run':R(28)}.get(kind,R(4))
    el={'walk':R(18),'run':R(85)}.get(kind,R(15))
    for g,side in ((-1,'right'),(1,'left')):
        sw=-g*c # right: +c at RHS means back
        flex=R(2 if not run else -8)+arm*(g*c) 
        rot[:,sk.joint(side+'_upper_arm')]=qm(Z(g*R(7 if not run else 12)+0*t),X(-flex))
        rot[:,sk.joint(side+'_forearm')]=X(-(el+.6*arm*(1+g*c)))
        for f in('index','middle','ring','little'):
            for k in(1,2,3): rot[:,sk.joint(f'{side}_{f}_{k}')]=Z(-g*R(18 if not run else 40)+0*t)
    ev=[]
    for n in range(2):
        for o,(a,b,c_,d_) in ((0,(E.RHS,E.RTS,E.RHO,E.RTO)),(.5,(E.LHS,E.LTS,E.LHO,E.LTO))):
            for e_,uu in ((a,0),(b,max(uf,.005)),(c_,uh),(d_,beta)): ev.append((float(np.mod((n+o+uu)*T,2*T)),e_))
    ev.sort(key=lambda x:(round(x[0],6),int(x[1])))
    return Clip(name,ClipKind.LOCOMOTION,fps,rot.astype(np.float32),pel.astype(np.float32),rp,ry,True,tuple(ev),(v,w,s),2)
def idle(name,seed):
    sk=build_skeleton();fps=60;T=8;t=np.arange(T*fps+1)/fps;rng=np.random.default_rng(seed)
    base=gait('x',kind='inplace')
    J=sk.joint_count;rot=np.zeros((len(t),J,4));rot[...,0]=1
    pel=np.stack([.012*np.sin(2*np.pi*t/T),.945+0*t,.006*np.sin(4*np.pi*t/T)],-1)
    from scipy.spatial.transform import Rotation
    for g,side in ((-1,'right'),(1,'left')):
        a=np.stack([g*.0875+0*t,.068+0*t,0*t],-1);hip=pel+sk.offset[sk.joint(side+'_thigh')];d=a-hip;L1,L2=.429,.431;L=np.minimum(np.linalg.norm(d,axis=-1),.8595)
        e=-d/np.linalg.norm(d,axis=-1,keepdims=True);hx=np.cross(qr(Y(g*R(4)),np.array([0,0,1.])),d);hx/=np.linalg.norm(hx,axis=-1,keepdims=True)
        F=Rotation.from_matrix(np.stack([hx,e,np.cross(hx,e)],-1)).as_quat()[:,[3,0,1,2]]
        al=np.arccos(np.clip((L1*L1+L*L-L2*L2)/(2*L1*L),-1,1));ka=np.pi-np.arccos(np.clip((L1*L1+L2*L2-L*L)/(2*L1*L2),-1,1))
        th=qm(F,X(-al));sh=qm(th,X(ka));rot[:,sk.joint(side+'_thigh')]=th;rot[:,sk.joint(side+'_shank')]=X(ka);rot[:,sk.joint(side+'_foot')]=qm(qc(sh),Y(g*R(6)+0*t))
        rot[:,sk.joint(side+'_upper_arm')]=qm(Z(g*R(7)+0*t),X(-R(2)+R(1)*np.sin(2*np.pi*t/4)));rot[:,sk.joint(side+'_forearm')]=X(-R(14)+0*t)
        for f in('index','middle','ring','little'):
            for k in(1,2,3): rot[:,sk.joint(f'{side}_{f}_{k}')]=Z(-g*R(18)+0*t)
    rot[:,3]=X(R(1.2)*np.sin(2*np.pi*t/4));rot[:,7]=Y(R(20 if seed else 3)*np.sin(2*np.pi*t/T)**3)
    z=np.zeros((len(t),3))
    return Clip(name,ClipKind.IDLE,fps,rot.astype(np.float32),pel.astype(np.float32),z,np.zeros(len(t)),True)
@cache
def built_in_library():
    sk=build_skeleton();c=[gait('in_place',kind='inplace')]
    for n,v,k in(('walk_slow',.7,'walk'),('walk',1.35,'walk'),('walk_fast',1.9,'walk'),('jog',2.6,'run'),('run',4.,'run'),('back_slow',-.6,'back'),('back',-1.1,'back')): c.append(gait(n,v,kind=k))
    for g,sd in((1,'left'),(-1,'right')):
        c+=[gait('walk_wide_'+sd,1.25,40*g),gait('walk_tight_'+sd,.9,110*g),gait('run_wide_'+sd,3.4,50*g,kind='run'),gait('run_tight_'+sd,2.5,120*g,kind='run'),gait('turn_'+sd,0,150*g,kind='turn'),gait('side_slow_'+sd,0,0,.5*g,kind='side'),gait('side_fast_'+sd,0,0,1.1*g,kind='side')]
    c+=[idle('idle',0),idle('idle_look',1)]
    i=c[-1];rot=i.rotation_local.copy()
    for gn in ('wave_right','wave','talk_both_hands','talk','look_around','point','shrug','applaud','check_phone','check_watch','point_right','clap','nod'):
     c.append(Clip(gn,ClipKind.GESTURE,60,rot[:150],i.pelvis_position_root[:150],i.root_position[:150],i.root_yaw[:150],False,mask=JointMask.RIGHT_ARM))
    return MotionLibrary('built-in',sk,tuple(c),'draft','MIT')
